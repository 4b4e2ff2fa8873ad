"""What reading an SDF costs grows with the file, and no faster."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from sim_action.core.errors import ModelError
from tests.robot.reading.sdf.models import link, load, sdf
from tests.work import work_of


def before_the_first_link(count: int) -> str:
    return sdf(*(f'<frame name="f{n}"/>' for n in range(count)), link("a"))


def without_a_link(count: int) -> str:
    return sdf(*(f'<frame name="f{n}"/>' for n in range(count)))


def attached_in_a_circle(count: int) -> str:
    ends = ((n, (n + 1) % count) for n in range(count))
    frames = (f'<frame name="f{n}" attached_to="f{other}"><pose relative_to="a"/></frame>' for n, other in ends)
    return sdf(link("a"), *frames)


def placed_in_a_circle(count: int) -> str:
    frames = (f'<frame name="f{n}"><pose relative_to="f{(n + 1) % count}"/></frame>' for n in range(count))
    return sdf(link("a"), *frames)


def chained_to_nothing(count: int) -> str:
    return sdf(link("a"), *(f'<frame name="f{n}" attached_to="f{n + 1}"/>' for n in range(count)))


@pytest.mark.parametrize(
    "text",
    [before_the_first_link, without_a_link, attached_in_a_circle, placed_in_a_circle, chained_to_nothing],
    ids=lambda text: text.__name__,
)
def test_frames_cost_the_same_each(text: Callable[[int], str], tmp_path: Path) -> None:
    def read(count: int) -> None:
        with suppress(ModelError):
            load(tmp_path, text(count))

    small, large = work_of(lambda: read(200)), work_of(lambda: read(400))
    assert large < 2.2 * small
