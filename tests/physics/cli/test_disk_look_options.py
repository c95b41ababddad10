# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of ``render`` that change the disk's look."""

import argparse

import pytest

from physics import DISK_PRESETS, DISK_SETTINGS, SKY_ARGUMENTS, SKY_SETTINGS, BlackHoleError
from physics.cli import disk_options, render_command


def parsed(*arguments):
    parser = argparse.ArgumentParser()
    render_command.add_options(parser)
    return parser.parse_args(["map.exr", "sky.exr", "picture.png", *map(str, arguments)])


def test_without_options_a_look_is_the_preset():
    for name, look in DISK_PRESETS.items():
        assert disk_options.look_of(parsed("--disk-look", name)) == look


@pytest.mark.parametrize("name", DISK_SETTINGS)
def test_each_setting_has_an_option_that_replaces_it(name):
    setting, preset = DISK_SETTINGS[name], DISK_PRESETS["ember"]
    value = setting.choices[0].value if setting.choices else 0.25 * setting.low + 0.75 * setting.high
    look = disk_options.look_of(parsed("--disk-look", "ember", setting.option, value))
    expected = value + getattr(preset, name) if setting.is_added else value
    assert getattr(look, name) == expected
    assert {key: each for key, each in vars(look).items() if key != name} == {
        key: each for key, each in vars(preset).items() if key != name
    }


@pytest.mark.parametrize("name", [name for name, setting in DISK_SETTINGS.items() if not setting.choices])
def test_values_out_of_range_are_refused(name):
    setting = DISK_SETTINGS[name]
    with pytest.raises(BlackHoleError, match=f"give it a value from {setting.low:g} to {setting.high:g}"):
        disk_options.look_of(parsed(setting.option, 2.0 * setting.high + 1.0))


def test_the_skys_options_are_arguments_of_the_renderer():
    defaults = {SKY_ARGUMENTS[name]: setting.default for name, setting in SKY_SETTINGS.items()}
    assert render_command.sky_arguments(parsed()) == defaults
    assert render_command.sky_arguments(parsed("--redshift-color", 0.5)) == defaults | {"color_amount": 0.5}
    assert render_command.sky_arguments(parsed("--redshift-colour", 0.5)) == defaults | {"color_amount": 0.5}
