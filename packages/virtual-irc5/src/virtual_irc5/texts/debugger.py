"""Refusals of a check of RAPID, and of the debugger."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

DEBUGGER: Mapping[str, Text] = {
    "file_unreadable": Text("{file} cannot be read: {reason}"),
    "task_is_running": Text("{task} is running", "`stop` it first"),
    "tasks_are_running": Text("{tasks:and} are running", "`stop` them first"),
    "task_unknown": Text("the controller has no task {task}; it has {tasks:list}"),
    "debugger_command_unknown": Text("there is no command {command:quoted}", "`help` lists them"),
    "motors_off_for_program": Text("the motors are off (controller state {state})", "switch them on first"),
    "tasks_without_pointer": Text("{tasks:and} may need a program pointer", "`main` moves all to main"),
    "event_log_may_tell": Text("its event log may tell why"),
    "controller_refuses_it": Text("the controller refuses it: {reason}", "{reason:remedy}"),
    "task_without_pointer": Text("{task} has no program pointer", "`main` moves it to main"),
    "start_not_confirmed": Text("not started: this starts {tasks:and}, and arms may move", "confirm it, or give --yes"),
    "place_expected": Text("{command} takes a module and a line, such as {command} Program:12, not {argument:quoted}"),
    "module_unknown": Text("{task} has no module {module:quoted}; it has {modules:list}"),
    "no_breakpoints_here": Text(
        "this controller has no breakpoints over Robot Web Services", "set them in RobotStudio"
    ),
    "line_beyond_module": Text("{module} has {count} lines, not {line}"),
    "no_statement_at_line": Text(
        "no statement begins at line {line} of {module} ({text}); execution stops before statements only"
    ),
    "no_statement_at_empty_line": Text(
        "no statement begins at line {line} of {module} (an empty line); execution stops before statements only"
    ),
    "no_breakpoint": Text("there is no breakpoint at {module}:{line}; breakpoints: {breakpoints:list}"),
    "frame_number_expected": Text("`locals` takes a number of `where`, such as `locals 1`, not {argument:quoted}"),
    "no_frame": Text("there is no #{number}", "`where` lists them"),
    "datum_needs_module": Text("{reason}", "{reason:remedy}; or name it as MODULE/NAME"),
    "no_datum_in_routine": Text(
        "there is no datum {name:quoted} in {module}/{routine}, nor in {module}", "`print` alone lists them"
    ),
    "no_datum": Text("there is no datum {name:quoted} in {block}", "`print` alone lists them"),
    "datum_and_value_expected": Text("`set` takes a datum and its value, such as `set count 3`"),
    "loop_variable_not_set": Text("{name} is a loop variable, which cannot be set"),
    "constant_not_set": Text("{name} is a constant, which cannot be set"),
    "no_value_of_datum": Text("{value:cut} is not a value of {name}, which is a {type}"),
}
