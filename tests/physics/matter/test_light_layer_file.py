# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of layers of light, and the command line that makes them and lays them over a sky."""

import argparse
import dataclasses

import numpy as np
import pytest

import physics
from physics.cli import bake_command, disk_options
from physics.cli.main import main
from physics.files.light_layer_file import FORMAT, light_layer_path, read_light_layer, write_light_layer
from physics.light.matter_settings import MATTER_PRESETS, MATTER_SETTINGS, MatterLook

BAKE = ("--width", 64, "--height", 36, "--radius", 30, "--fov", 40)


def command(*arguments):
    return main([str(each) for each in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("layer")
    options = ("--disk", "--light", "--light-look", "gargantua", "--light-exposure", 1, "--light-time", 12)
    assert command("bake", path / "map.exr", *BAKE, *options) == 0
    physics.write_exr(path / "sky.exr", np.full((16, 32, 3), 0.25, dtype=np.float32))
    return path


def test_a_layer_comes_back_as_it_was_written(folder, tmp_path):
    layer = read_light_layer(folder / "map_light.exr")
    assert layer.metadata["time"] == 12.0
    look = MatterLook(**layer.metadata["look"])
    own = MATTER_PRESETS["gargantua"]
    assert look == dataclasses.replace(own, exposure=own.exposure + 1.0)
    assert layer.light.shape == (36, 64, 3)
    assert layer.light.max() > 0.1
    assert 0.5 < (1.0 - layer.transmittance).max() <= 1.0
    write_light_layer(tmp_path / "again.exr", layer)
    again = read_light_layer(tmp_path / "again.exr")
    np.testing.assert_array_equal(again.light, layer.light)
    np.testing.assert_array_equal(again.transmittance, layer.transmittance)
    assert again.metadata == layer.metadata
    assert physics.check_map(tmp_path / "again.exr", FORMAT).state is physics.MapState.VALID


def test_render_lays_the_layer_over_the_sky(folder):
    for name, options in (("bare", ()), ("lit", ("--light",))):
        assert command("render", folder / "map.exr", folder / "sky.exr", folder / f"{name}.exr", *options) == 0
    bare, lit = (physics.read_exr(folder / f"{name}.exr")[0][..., :3] for name in ("bare", "lit"))
    layer = read_light_layer(folder / "map_light.exr")
    np.testing.assert_allclose(lit, layer.light + layer.transmittance[..., None] * bare, atol=1e-5)


def test_a_layer_of_another_map_is_refused(folder, tmp_path, capsys):
    assert command("bake", tmp_path / "map.exr", *BAKE, "--spin", 0.5) == 0
    (tmp_path / "map_light.exr").write_bytes((folder / "map_light.exr").read_bytes())
    assert command("render", tmp_path / "map.exr", folder / "sky.exr", tmp_path / "a.png", "--light") == 1
    assert "does not belong to" in capsys.readouterr().err
    assert not (tmp_path / "a.png").exists()


def test_damaged_layers_are_refused(folder, tmp_path):
    layer = read_light_layer(folder / "map_light.exr")
    for wrong in (
        dataclasses.replace(layer, light=-layer.light),
        dataclasses.replace(layer, transmittance=0.0 * layer.transmittance),
        dataclasses.replace(layer, transmittance=1.5 * layer.transmittance),
        dataclasses.replace(layer, metadata={**layer.metadata, "time": 13.0}),
        dataclasses.replace(layer, metadata={**layer.metadata, "look": {"depth": -1.0}}),
    ):
        write_light_layer(tmp_path / "wrong.exr", wrong)
        with pytest.raises(physics.WarpMapError, match="damaged"):
            read_light_layer(tmp_path / "wrong.exr")


def test_names():
    assert light_layer_path("//maps/Scene_0001.exr") == "//maps/Scene_light_0001.exr"


def parsed(*arguments):
    parser = argparse.ArgumentParser()
    bake_command.add_options(parser)
    return parser.parse_args(["map.exr", "--disk", "--light", *map(str, arguments)])


@pytest.mark.parametrize("name", MATTER_SETTINGS)
def test_each_setting_has_an_option_that_replaces_it(name):
    setting, preset = MATTER_SETTINGS[name], MATTER_PRESETS["gargantua"]
    value = setting.choices[-1].value if setting.choices else 0.25 * setting.low + 0.75 * setting.high
    value = type(setting.default)(value)
    look, _ = disk_options.light_of(parsed("--light-look", "gargantua", setting.option, value))
    expected = value + getattr(preset, name) if setting.is_added else value
    assert look == dataclasses.replace(preset, **{name: expected})


def test_light_without_a_disk_is_refused(tmp_path, capsys):
    for options, sentence in ((("--light",), "add --disk"), (("--disk", "--light-depth", 2), "add --light")):
        assert command("bake", tmp_path / "map.exr", *BAKE, *options) == 1
        assert sentence in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
