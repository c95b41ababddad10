# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line as a process: odd numbers, closed and full streams, little memory, and Ctrl-C at any time."""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from physics import BlackHoleError, bake, read_exr, render_reference, write_exr
from physics.cli import main, make_parser

ROOT = Path(__file__).parents[3]
SMALL = ("--width", "16", "--height", "9")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, small_patterns):
    folder = tmp_path_factory.mktemp("folder")
    write_exr(folder / "sky.exr", np.full((16, 32, 3), 0.25, np.float32))
    disk = ("--radius", "30", "--disk", "--disk-crossings", "1", "--light")
    assert main(["bake", str(folder / "map.exr"), *SMALL, *disk]) == 0
    return folder


def command(folder, name):
    """Arguments of a command that writes ``folder/out`` and so on."""
    return {
        "bake": ["bake", str(folder / "out.exr"), *SMALL, "--disk", "--light"],
        "render": ["render", *(str(folder / each) for each in ("map.exr", "sky.exr", "out.png")), "--light"],
        "accuracy": ["accuracy", str(folder / "map.exr"), "--samples", "20"],
        "verify": ["verify", str(folder)],
    }[name]


def options_of(name, kind):
    """The options of a command that take a number of some kind, with how many of it they take."""
    (commands,) = (action for action in make_parser()._actions if action.choices and "bake" in action.choices)
    actions = commands.choices[name]._actions
    return [(each.option_strings[0], each.nargs or 1) for each in actions if each.type is kind and each.option_strings]


NUMBERS = [(name, *option) for name in ("bake", "render") for option in options_of(name, float)]


def given(option, count, value):
    """The words for an option; several values cannot begin with a minus, which argparse takes for an option."""
    return [f"{option}={value}"] if count == 1 else [option, *([value.lstrip("-")] * count)]


@pytest.mark.parametrize("value", ["inf", "-inf", "nan"])
@pytest.mark.parametrize(("name", "option", "count"), NUMBERS)
def test_no_option_takes_what_is_no_finite_number(folder, capsys, name, option, count, value):
    before = sorted(folder.iterdir())
    assert main([*command(folder, name), *given(option, count, value)]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"error: {option.replace('colour', 'color')}")
    assert "finite number" in said
    assert said.count("\n") == 1
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("value", ["1e308", "-1e308", "1e9", "-1e9", "1e-308", "0"])
@pytest.mark.parametrize(("name", "option", "count"), NUMBERS)
def test_numbers_far_out_are_refused_or_taken(folder, capsys, tmp_path, name, option, count, value):
    """Either one sentence and no file, or files: never a traceback, a warning, or half of both."""
    words = [each.replace(f"{folder}/out.", f"{tmp_path}/out.") for each in command(folder, name)]
    status = main([*words, *given(option, count, value)])
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith(("tracing", "note: "))]
    if status == 1:
        assert len(said) == 1
        assert said[0].startswith("error: ")
        assert not list(tmp_path.iterdir())
    else:
        assert (status, said) == (0, [])
        for path in tmp_path.glob("*.png"):
            assert path.stat().st_size > 0
        for path in tmp_path.glob("*.exr"):
            read_exr(path)


@pytest.mark.parametrize(
    ("name", "option", "value"),
    [
        ("bake", "--radius", "5e-324"),
        ("bake", "--light-time", "1e13"),
        ("bake", "--light-depth", "-1"),
        ("accuracy", "--seed", "-1"),
        ("accuracy", "--seed", "9" * 400),
        ("accuracy", "--samples", "9" * 400),
        ("accuracy", "--environment-width", "9" * 400),
        ("accuracy", "--environment-width", "0"),
        ("bake", "--width", "9" * 400),
        ("bake", "--disk-crossings", "9" * 400),
        ("render", "--exposure", "1e9"),
        ("render", "--temperature", "0"),
        ("render", "--redshift-color", "2"),
    ],
)
def test_numbers_out_of_range_are_refused(folder, capsys, name, option, value):
    before = sorted(folder.iterdir())
    assert main([*command(folder, name), option, value]) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    assert len(said) < 300
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    "settings",
    [
        {"exposure": math.nan},
        {"exposure": 1e9},
        {"exposure": "bright"},
        {"strength": math.inf},
        {"rotation": (0.0, math.nan, 0.0)},
        {"rotation": (0.0, 0.0)},
    ],
)
def test_the_reference_renderer_takes_finite_settings(settings):
    from shots import shot

    sky = np.ones((8, 16, 3), np.float32)
    with pytest.raises(BlackHoleError):
        render_reference(bake(shot(8, 4)), sky, **settings)


# --- streams ----------------------------------------------------------------------------------------


def process(arguments, **streams):
    return subprocess.Popen(
        [sys.executable, "-m", "physics", *arguments], cwd=ROOT, **{"stderr": subprocess.PIPE, **streams}
    )


def one_sentence(text, words):
    lines = [line for line in text.decode().splitlines() if not line.startswith("tracing")]
    assert len(lines) == 1, lines
    assert lines[0].startswith("error: ")
    assert words in lines[0].lower()


@pytest.mark.parametrize("name", ["bake", "render", "accuracy", "verify", "help"])
@pytest.mark.parametrize("how", ["closed pipe", "full device"])
def test_standard_output_that_takes_nothing(folder, name, how):
    """One sentence and exit status 1; files that would be told of there are not written."""
    arguments = ["bake", "--help"] if name == "help" else command(folder, name)
    if how == "full device":
        if not os.path.exists("/dev/full"):
            pytest.skip("there is no full device here")
        with open("/dev/full", "w") as full:
            child = process(arguments, stdout=full)
            said = child.communicate()[1]
    else:
        reading, writing = os.pipe()
        os.close(reading)
        child = process(arguments, stdout=writing)
        os.close(writing)
        said = child.communicate()[1]
    assert child.returncode == 1
    one_sentence(said, "standard output")
    assert not list(folder.glob("*out*"))


@pytest.mark.skipif(os.name == "nt", reason="by a shell's words")
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "2>/dev/full"])
def test_streams_that_are_not_there(folder, tmp_path, closed):
    line = f"exec {sys.executable} -m physics bake {tmp_path / 'map.exr'} {' '.join(SMALL)} {closed}"
    assert subprocess.run(line, shell=True, cwd=ROOT, check=False).returncode == 0
    assert [each.name for each in tmp_path.iterdir()] == ["map.exr"]


# --- memory -----------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited as Linux does")
@pytest.mark.parametrize("name", ["bake", "sky"])
def test_pictures_beyond_memory(folder, tmp_path, name):
    """A process that may have 1.5 GB: one sentence, and nothing written."""
    import resource

    big, limit = tmp_path / "big.exr", 1_500_000_000
    if name == "sky":
        write_exr(big, np.zeros((8192, 16384, 3), np.float16))  # 0.8 GB, and twice that in float32
    arguments = {
        "bake": ["bake", str(tmp_path / "out.exr"), "--width", "16384", "--height", "16384"],
        "sky": ["render", str(folder / "map.exr"), str(big), str(tmp_path / "out.png")],
    }[name]
    child = subprocess.run(
        [sys.executable, "-m", "physics", *arguments],
        cwd=ROOT,
        capture_output=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # each thread takes address space
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )
    assert child.returncode == 1
    one_sentence(child.stderr, "memory")
    assert not list(tmp_path.glob("*out*"))


# --- Ctrl-C -----------------------------------------------------------------------------------------


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signal")
@pytest.mark.parametrize("after", ["physics.numerics.interrupts", "numpy.linalg", "physics.shot.disk", "argparse"])
def test_ctrl_c_from_the_first_module_to_the_work(tmp_path, after):
    """One sentence, and nothing written, at any time after the first module is imported."""
    arguments = ["bake", str(tmp_path / "map.exr"), "--width", "2048", "--height", "2048", "--interpolation", "0"]
    for wait in (0.0, 0.01, 0.1, 0.4):
        # Python tells of each module on standard error when it has imported it
        start = [sys.executable, "-X", "importtime", "-m", "physics", *arguments]
        with subprocess.Popen(start, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
            for line in child.stderr:
                if line.decode().rpartition("|")[2].strip() == after:
                    break
            time.sleep(wait)
            child.send_signal(signal.SIGINT)
            output, said = child.communicate(timeout=60)
        assert child.returncode == 130
        assert said.decode().strip().endswith("canceled: nothing was written")
        assert b"Traceback" not in said
        assert not output
        assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signal")
@pytest.mark.parametrize("module", ["numpy", "physics.accuracy_check", "physics.cli.main", "OpenEXR"])
def test_ctrl_c_while_a_module_is_imported(tmp_path, module):
    """The signal comes just when that module is looked for, whichever machine this is."""
    script = f"""
import os, runpy, signal, sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
sys.orig_argv = [sys.executable, "-m", "physics", "bake", "--help"]
sys.argv = ["-m", "bake", "--help"]
runpy._run_module_as_main("physics")
"""
    child = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert child.returncode == 130
    assert child.stderr.strip() == "canceled: nothing was written"
    assert not child.stdout
