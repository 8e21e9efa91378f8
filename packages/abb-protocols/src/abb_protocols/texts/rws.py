"""Robot Web Services: the connection, the session, what the controller refuses, and answers without meaning."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

RWS: Mapping[str, Text] = {
    # ---- the connection
    "no_address": Text("{address:quoted} is not an address", "give a host name or IP address, with :port if not 80"),
    "nothing_at_address": Text(
        "nothing answers at {address} within {timeout:.1f} s",
        "check the address, the cable and that the controller is switched on",
    ),
    "address_unknown": Text("no machine named {address} is known", "check the address"),
    "connection_refused": Text(
        "the machine at {address} refuses the connection: no controller listens there",
        "check address and port, or start the virtual controller",
    ),
    "address_not_reached": Text("there is no way to {address} ({error})", "check the address and the network"),
    "no_descriptor_for_connection": Text(
        "no file descriptor is left for a connection to {address}", "raise the limit (ulimit -n)"
    ),
    "no_http_answer": Text(
        "{address} closed the connection without an HTTP answer",
        "a restart takes minutes: try again, and check that a controller listens there (its port is 80)",
    ),
    "no_http_spoken": Text(
        "something answers at {address}, but it does not speak HTTP as a controller does",
        "check the address and the port (a controller's is 80)",
    ),
    "no_answer_to_request": Text("{address} accepted the connection but did not answer within {timeout:.1f} s"),
    "no_answer_in_time": Text("{address} did not answer within {timeout:.1f} s"),
    "answer_not_ended": Text("{address} is too slow: its answer did not end in time"),
    "answer_too_long": Text("the answer of {address} is longer than {most} bytes"),
    "answer_head_too_long": Text("the head of the answer of {address} is longer than {most} bytes"),
    "request_not_http": Text("the request to {address} cannot be put into HTTP: {error}"),
    # ---- WebSockets
    "websocket_refused": Text("{address} does not open a WebSocket at {target}: it answers HTTP {status}"),
    "websocket_not_opened": Text("{address} did not open a WebSocket within {timeout:.1f} s"),
    "websocket_not_reached": Text("the WebSocket of {address} cannot be reached ({error})"),
    "no_descriptor_for_websocket": Text(
        "no file descriptor is left for the WebSocket of {address}", "raise the limit (ulimit -n)"
    ),
    "websocket_broke": Text("the WebSocket of {address} broke"),
    "websocket_closed": Text("{address} has closed the WebSocket (code {number})"),
    "no_resource_named": Text("a subscription needs a resource", "name at least one"),
    "subscription_without_websocket": Text("the answer of {address} to a subscription names no WebSocket"),
    # ---- the session
    "no_controller_answers": Text(
        "a web server answers at {address}, but it is not an IRC5 controller with Robot Web Services 1.0: {reason}",
        "check the address and the port",
    ),
    "answers_without_session": Text("it answers HTTP {status} without a session"),
    "asks_for_other_login": Text("it asks for another kind of login"),
    "login_for_other_realm": Text("its login is for {realm:quoted}"),
    "login_refused": Text(
        "the controller at {address} does not accept user {user:quoted} with this password",
        "give the right ones (a new controller has the user 'Default User' with password 'robotics')",
    ),
    "sessions_taken": Text(
        "the controller at {address} is starting, or all its {most} sessions are taken (an idle one ends after five "
        "minutes)",
        "try again later",
    ),
    "client_abandoned": Text("{address} is not asked any more: this program is ending"),
    "other_requests_under_way": Text("{address} is busy with other requests for {timeout:.1f} s", "ask again"),
    # ---- what the controller refuses
    "rws_refused": Text("{address}: {what} was refused: {reason:full} (HTTP {status}, {name})"),
    "rws_refused_without_code": Text("{address}: {what} was refused with HTTP status {status}"),
    "rws_no_reason": Text("the controller gives no reason"),
    # return codes of ABB, by their names
    "rws_reject": Text('the controller does not let remote clients write this; a signal needs Access "All"'),
    "rws_invalidarg": Text("a value in the request is not allowed"),
    "rws_uas_reject": Text("the user lacks the grant for it", "log in as another user"),
    "rws_unresolved_url": Text("the controller has nothing of that name"),
    "rws_denied": Text("the controller denied it"),
    "rws_resource_held": Text("another client holds the mastership", "release it there (FlexPendant, RobotStudio)"),
    "rws_mode_reject": Text("the operating mode forbids it", "switch the controller to AUTO"),
    "rws_master_reject": Text(
        "it needs the mastership, which another client or, in manual mode, the FlexPendant holds",
        "switch to AUTO and release the mastership there",
    ),
    "rws_sysfail_reject": Text("the controller is in system failure", "restart it"),
    "rws_no_such_symbol": Text("no such RAPID symbol", "load the robot-side program, or check the name"),
    "rws_exec_state": Text(
        "the state of the RAPID execution forbids it",
        "to start, switch the motors on, set the program pointer and stop the tasks; to move the program pointer, "
        "stop the tasks",
    ),
    "rws_task_state": Text("the state of the RAPID task forbids it", "check that its program loads without errors"),
    "rws_syntax": Text("the value is not a RAPID value of the symbol's type, or the module is not RAPID"),
    "rws_module_name_taken": Text("the task has a module of that name", "unload it first, or replace it"),
    "rws_file_not_found": Text("the controller has no such file", "upload it first"),
    "rws_max_limit_reached": Text("the controller grants no more of these", "end one first"),
    "rws_symbol_not_persistent": Text("the variable is not persistent; only PERS can be subscribed"),
    "rws_semantic": Text("the value does not fit the symbol's type"),
    "rws_no_pp": Text("no task has a program pointer", "move it to main first"),
    "rws_cfg_type_invalid": Text("the configuration has no such type"),
    "rws_cfg_domain_invalid": Text("the configuration has no such domain"),
    "rws_no_such_mechunit": Text("the controller has no such mechanical unit"),
    "rws_unblocked_insignal": Text("a device drives this input signal; only outputs and virtual inputs are written"),
    "rws_invalid_state": Text("the controller's state forbids it", "release the emergency or guard stop first"),
    # ---- requests to the controller
    "speed_ratio_out_of_range": Text("a speed ratio of {percent} % is not possible", "give {lowest} to {highest}"),
    "mode_needs_no_confirmation": Text("a change to {mode} needs no confirmation; AUTO and MANF do"),
    "signal_does_not_keep": Text(
        "signal {signal} of {address} does not keep the value {value}",
        "find what else writes this signal",
    ),
    "jog_of_other_length": Text("jogging takes six deflections, not {count}"),
    "file_not_latin_1": Text("RAPID files hold Latin-1 only; {path} cannot have {character:quoted} in it"),
    "restart_not_begun": Text(
        "the controller at {address} does not restart in {deadline:.0f} s", "look at its FlexPendant"
    ),
    "restart_not_ended": Text(
        "the controller at {address} does not come back in {deadline:.0f} s", "look at its FlexPendant"
    ),
    "job_without_progress": Text("{address}: {what} was begun, but the controller does not say how far it is"),
    "job_failed": Text("{address}: {what} failed: {state}"),
    "job_not_ended": Text("{address}: {what} does not end within {deadline:.0f} s"),
    "no_privilege_requested": Text(
        "{address}: there is no request for the remote manual mode privilege, or no longer", "make one"
    ),
    "privilege_not_granted": Text(
        "{address}: the remote manual mode privilege was not granted within {timeout:.0f} s",
        "grant it on the FlexPendant",
    ),
    "privilege_denied": Text("{address}: the remote manual mode privilege was denied on the FlexPendant"),
    # ---- answers without meaning
    "answer_not_xhtml": Text("the answer is {kind}, not XHTML"),
    "answer_of_no_type": Text("the answer is of no type, not XHTML"),
    "document_too_long": Text("the answer is a document of {size} bytes; a controller's has {most} at most"),
    "document_with_doctype": Text("the answer is a document with a DOCTYPE, which no controller sends"),
    "document_not_well_formed": Text("the answer is not well-formed XHTML"),
    "document_without_division": Text(
        "the answer is not a document of Robot Web Services: it has no {division:quoted} division"
    ),
    "document_nested_too_deeply": Text(
        "the answer has more than {most} lists within each other, which no controller sends"
    ),
    "error_without_code": Text("the controller's error document holds no code"),
    "answer_without_state": Text("the controller's answer holds no {types:or}"),
    "answer_without_states": Text("the controller's answer holds no state"),
    "state_without_field": Text("the controller's {type:quoted} of {title:quoted} lacks the field {field:quoted}"),
    "field_no_number": Text("the controller's {field:quoted} is {text:quoted}, not a number"),
    "field_no_whole_number": Text("the controller's {field:quoted} is {text:quoted}, not a whole number"),
    "word_without_meaning": Text("the controller answers {word:quoted} where only {allowed:list} have a meaning"),
    "version_not_numbers": Text("the controller's RobotWare version {version:quoted} is not numbers and dots"),
    "clock_shows_no_time": Text("the controller's clock shows {text:quoted}, which is not a time"),
    "answer_without_properties": Text("the controller's answer holds no properties of a symbol"),
    "event_without_number": Text("the controller's event {title:quoted} has no number"),
    "unit_without_seventh_axis": Text("the mechanical unit has no seventh axis; it is not an arm of a YuMi"),
    # ---- RAPID values and cfg files
    "rapid_number_not_finite": Text("RAPID has no number {value}", "give a finite one"),
    "rapid_value_without_brackets": Text("{text:quoted} is not a RAPID record or array: it lacks its brackets"),
    "rapid_value_not_closed": Text("{text:quoted} is not a RAPID record or array: brackets or quotes do not match"),
    "rapid_value_nested_too_deeply": Text("the RAPID value is nested too deeply"),
    "rapid_value_unreadable": Text("{text:quoted} is not a RAPID value"),
    "cfg_file_without_domain": Text("a cfg file begins with its domain, such as EIO:CFG_1.0, not {header:quoted}"),
}
