"""Settings with which a virtual controller's arms follow EGM: read, written, refused, used."""

from __future__ import annotations

from math import radians
from pathlib import Path

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import CHAIN_AXES, Side
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_parameters import EgmParameters, read_egm_parameters, write_egm_parameters
from virtual_irc5.world import World, WorldSettings

MEASURED = EgmParameters(6.0, 0.003, 0.017, 0.004, {7: radians(90.0)})


def test_parameters_are_read_as_they_were_written(tmp_path: Path) -> None:
    write_egm_parameters(MEASURED, tmp_path / "new" / "yumi.yaml", "Of a test.")
    found = read_egm_parameters(tmp_path / "new" / "yumi.yaml")
    assert (found.position_gain, found.reference_delay, found.delay, found.lag) == (6.0, 0.003, 0.017, 0.004)
    assert found.speed_limits == pytest.approx(MEASURED.speed_limits)


def test_virtual_robot_has_the_parameters_of_its_settings() -> None:
    world = World(WorldSettings(egm_parameters=MEASURED))
    model = world.arms[Side.LEFT].model
    assert (model.reference_delay, model.delay, model.lag) == (0.003, 0.017, 0.004)
    assert model.limits.velocity[CHAIN_AXES.index(7)] == radians(90.0)
    configuration = world.controller.configuration
    gains = {each.attributes["ext_motion_Kp"] for each in configuration.instances("MOC", "EXT_MOTION_DATA")}
    assert {float(gain) for gain in gains} == {6.0}


def test_what_is_left_out_stays_as_it_is() -> None:
    assert EgmParameters(delay=0.02).applied(ArmModel(), CHAIN_AXES).lag == ArmModel().lag
    plain, none = World(WorldSettings()), World(WorldSettings(egm_parameters=EgmParameters()))
    assert none.arms[Side.LEFT].model == plain.arms[Side.LEFT].model


def out_of_range(parameter: str, value: str, lowest: float, highest: float, unit: str) -> Message:
    return message(
        "value_out_of_range_with_unit", parameter=parameter, value=value, lowest=lowest, highest=highest, unit=unit
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "gain: 5.0",
            "there is no parameter 'gain'; there are position_gain, reference_delay, delay, lag, speed_limits.",
        ),
        ("position_gain: 30.0", out_of_range("position_gain", "30", 0.0, 20.0, "1/s")),
        ("delay: soon", message("value_of_wrong_type", parameter="delay", value="'soon'", type="a number")),
        ("speed_limits: 90.0", "speed_limits is 90.0; needed are axes with speeds"),
        ("speed_limits: {9: 90.0}", "speed_limits names axis '9'; allowed are 1 to 7."),
        ("speed_limits: {2: -1.0}", out_of_range("speed_limits", "-1", 0.1, 10_000.0, "deg/s")),
    ],
)
def test_wrong_settings_are_refused_with_what_is_allowed(tmp_path: Path, text: str, said: str | Message) -> None:
    (tmp_path / "wrong.yaml").write_text(text)
    with pytest.raises(SettingsError) as refusal:
        read_egm_parameters(tmp_path / "wrong.yaml")
    if isinstance(said, Message):
        assert refusal.value.said == message("setting_refused", place="wrong.yaml", reason=said)
    else:  # only here, and not in the catalogue
        assert f"wrong.yaml: {said}" in str(refusal.value)
