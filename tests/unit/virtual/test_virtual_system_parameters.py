"""The configuration: ABB's cfg text in, instances out."""

import pytest

from abb_protocols.errors import SettingsError
from refusals import refused
from virtual_irc5.system_parameters import SystemConfiguration

TEXT = """EIO:CFG_1.0:6:1::
# a comment
EIO_SIGNAL:

      -Name "FIRST" -SignalType "DI" \\
      -Access "All"
      -Name "SECOND" -SignalType "DO" -Default 1

CAB:
      -Name "flag" -Hidden
"""


@pytest.fixture
def configuration() -> SystemConfiguration:
    return SystemConfiguration([TEXT])


def test_configuration_lists_instances_in_the_order_of_the_file(configuration: SystemConfiguration) -> None:
    assert [instance.name for instance in configuration.instances("EIO", "EIO_SIGNAL")] == ["FIRST", "SECOND"]


def test_configuration_joins_lines_that_end_in_a_backslash(configuration: SystemConfiguration) -> None:
    first = configuration.find("EIO", "EIO_SIGNAL", "FIRST")
    assert first is not None
    assert first.attributes["Access"] == "All"


def test_configuration_completes_instances_with_defaults(
    configuration: SystemConfiguration,
) -> None:
    second = configuration.find("EIO", "EIO_SIGNAL", "SECOND")
    assert second is not None
    assert (second.attributes["Access"], second.attributes["Default"]) == ("Default", "1")


def test_configuration_takes_an_attribute_without_value_for_a_flag(configuration: SystemConfiguration) -> None:
    assert configuration.instances("EIO", "CAB")[0].attributes["Hidden"] == "TRUE"


@pytest.mark.parametrize("domain", ["eio", "EIO"])
def test_configuration_finds_domains_and_types_in_any_case(configuration: SystemConfiguration, domain: str) -> None:
    assert configuration.types(domain) == ("EIO_SIGNAL", "CAB")
    assert configuration.find(domain, "eio_signal", "FIRST") is not None


def test_configuration_changes_single_attributes(configuration: SystemConfiguration) -> None:
    configuration.change("EIO", "EIO_SIGNAL", "FIRST", {"Access": "ReadOnly"})
    first = configuration.find("EIO", "EIO_SIGNAL", "FIRST")
    assert first is not None
    assert first.attributes == {**first.attributes, "Access": "ReadOnly", "SignalType": "DI"}


def test_configuration_refuses_text_without_a_domain() -> None:
    with refused(SettingsError, "cfg_file_without_domain", header="hello"):
        SystemConfiguration(["hello\nworld:\n"])
