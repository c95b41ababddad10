# SPDX-License-Identifier: GPL-3.0-or-later
"""Work behind the caller's back: nothing is lost, nothing goes wrong in silence."""

import threading

import pytest

from physics import Background


def test_work_goes_on_while_the_caller_does_other_things():
    may_end = threading.Event()
    done = []
    with Background() as background:
        background.start(lambda: done.append(may_end.wait(10.0)))
        assert not background.wait(0.001)
        assert done == []
        may_end.set()
        assert background.wait()
        assert done == [True]


def test_pieces_of_work_come_one_after_another():
    order = []
    with Background() as background:
        for number in range(5):
            background.start(lambda number=number: order.append(number))
    assert order == [0, 1, 2, 3, 4]


def fail():
    raise OSError("no space left")


def test_a_failure_is_raised_where_the_work_is_waited_for():
    background = Background()
    background.start(fail)
    with pytest.raises(OSError, match="no space left"):
        background.wait()
    assert background.wait()


def test_a_failure_keeps_the_next_piece_from_starting():
    started = []
    background = Background()
    background.start(fail)
    with pytest.raises(OSError, match="no space left"):
        background.start(lambda: started.append(1))
    assert started == []


def test_leaving_the_block_waits_and_raises():
    with pytest.raises(OSError, match="no space left"), Background() as background:
        background.start(fail)


def test_another_exception_on_its_way_comes_first_but_the_work_is_waited_for():
    done = []

    def stop_half_way():
        with Background() as background:
            background.start(lambda: done.append(1))
            raise KeyError

    with pytest.raises(KeyError):
        stop_half_way()
    assert done == [1]
