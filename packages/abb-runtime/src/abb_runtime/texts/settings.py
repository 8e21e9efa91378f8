"""Texts about settings: values, names and files that are refused."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

SETTINGS: Mapping[str, Text] = {
    "setting_refused": Text("{place}: {reason}", "{reason:remedy}"),
    # ---- a value
    "value_of_wrong_type": Text("{parameter} is {value}; it must be {type}"),
    "value_of_no_type": Text(
        "{place}: {parameter} is {value}; it must be a truth value, a number, a text or a list of one kind"
    ),
    "value_not_a_choice": Text("{parameter} is {value}; choose from: {choices:list}"),
    "value_out_of_range": Text("{parameter} is {value}; allowed is {lowest:g} to {highest:g}"),
    "value_out_of_range_with_unit": Text("{parameter} is {value}; allowed is {lowest:g} to {highest:g} {unit}"),
    "value_not_valid": Text("{place}: what stands there is not a valid {kind}", "quote a text"),
    "number_too_long": Text("{place}: a number has {length} characters; allowed are {limit}"),
    "secret_is_no_text": Text("{place} must be a text", "put it in quotes"),
    "namespace_not_of_ros": Text(
        "{setting} is {value:quoted}; it must be names of letters, digits and underscores with slashes between them, "
        "such as cell1"
    ),
    "prefix_not_of_ros": Text(
        "{setting} is {value:quoted}; it must be letters, digits and underscores and begin with a letter, such as a_"
    ),
    "setting_is_no_vector": Text("{place}: {setting} has {count} values; give x, y, z"),
    "box_without_size": Text("{place}: size is {size:list}; each edge must be longer than 0 m"),
    "wall_without_direction": Text("{place}: normal has no direction", "give one such as [0, 0, 1]"),
    "initial_controller_commands_nothing": Text(
        "{setting} is {controller:quoted}, which does not command the {arm} arm; choose from: {choices:list}"
    ),
    "controller_of_unknown_type": Text(
        "{place}: controller {controller:quoted} has type {type:quoted}; known are: {known:list}"
    ),
    "controllers_of_one_type": Text(
        "controllers {classes:and} have the same type, {type:quoted}", "give each a kind of its own"
    ),
    "egm_frame_not_rapid": Text(
        "{setting} is {value:quoted}; it must be a RAPID {type} such as {example}, with finite numbers"
    ),
    "egm_tool_refused": Text("{setting} is {value:quoted}: {reason}", "{reason:remedy}"),
    # ---- a name
    "setting_unknown": Text("{place} has no setting {setting:quoted}; it has: {known:list}"),
    "setting_given_twice": Text("{file} line {line}: {setting} stands in line {first} already", "remove one"),
    "setting_needs_mapping": Text("{place} needs a mapping, it has {value}"),
    "setting_needs_names": Text("{place} needs a mapping of names, it has {value}"),
    "section_of_no_node": Text("{place}: {name} is not the name of anything here; there are: {known:list}"),
    "section_without_parameters": Text("{place}: {name} needs a mapping 'ros__parameters'"),
    "no_controller_listed": Text("{file}: {name} lists no controller with a 'type'"),
    "controller_manager_setting_unknown": Text(
        "{place}: the controller manager has no setting {setting} = {value}; it has: <controller>.type, "
        "<controller>.initial_state, update_rate = {rate}, which the robot's datagrams give"
    ),
    "parameter_of_no_controller": Text("{place}: no controller has a parameter {parameter:quoted}"),
    # ---- a file
    "settings_unreadable": Text("cannot read {file}: {reason}"),
    "settings_too_large": Text(
        "{file} has more than {limit} kB, the most a file of settings may have", "give a smaller one"
    ),
    "settings_not_in_utf8": Text(
        "{file} is not text in UTF-8 from line {line} on: byte 0x{byte:02x}", "save it as UTF-8"
    ),
    "settings_not_yaml": Text("{file} is not YAML", "quote texts with special characters"),
    "settings_not_yaml_at": Text(
        "{file} is not YAML in line {line}, column {column}", "quote texts with special characters"
    ),
    "settings_without_mapping": Text("{file} must hold a mapping of settings"),
    "settings_nested_too_deeply": Text(
        "{file} line {line}: nested too deeply; allowed are {limit} levels",
    ),
    "too_many_settings": Text(
        "{file} has too many keys and values, up to line {line}; allowed are {limit}, and each use of an alias counts",
    ),
    "alias_in_itself": Text("{place}: an alias stands for what it is part of", "remove it"),
    "tag_not_allowed": Text("{place} has the tag {tag:quoted}", "remove it"),
    # ---- what is worth knowing
    "nothing_keeps_arms_apart": Text(
        "nothing keeps the arms apart from each other, the body and declared boxes: collision.enabled is false"
    ),
}
