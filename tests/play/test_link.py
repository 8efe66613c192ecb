"""The pace of frames to a page, over simulated links."""

import itertools
from collections import deque

import pytest

from marl_airhockey.play.link import STRIDES, Link
from marl_airhockey.play.live_match import RATE

FRAME = 5200.0
"""Bits of a frame on the wire"""


def simulate(bandwidth, seconds, trip=0.02, until=None):
    """Ages of frames as they arrive, s, and the rate of the last second, 1/s."""
    link, queue, ages, arrived = Link(0.0), deque(), [], []
    free, answers = 0.0, deque()
    for tick in range(round(seconds * RATE)):
        now = tick / RATE
        while answers and answers[0][1] <= now:
            link.acknowledge(*answers.popleft())
        while queue and queue[0][1] <= now:
            number, at, sent = queue.popleft()
            ages.append(at - sent)
            arrived.append(at)
            answers.append((number, at + trip / 2))
        if link.is_due(tick, now):
            link.note_sent(tick, now)
            width = bandwidth if until is None or now < until else 10 * bandwidth
            free = max(free, now) + FRAME / width
            queue.append((tick, free + trip / 2, now))
    return ages, sum(at > seconds - 1.0 for at in arrived), link


@pytest.mark.parametrize("bandwidth", [100e3, 200e3, 400e3])
@pytest.mark.parametrize("trip", [0.02, 0.2])
def test_no_frame_is_old_on_a_slow_link(bandwidth, trip):
    ages, rate, _ = simulate(bandwidth, 60.0, trip)
    assert max(ages) < trip / 2 + 0.42
    assert rate >= 9


def test_a_fast_link_gets_all_frames_and_a_distant_one_too():
    for trip in (0.001, 0.15):
        ages, rate, link = simulate(20e6, 10.0, trip)
        assert max(ages) < trip / 2 + 0.03
        assert rate >= 58
        assert link.rate == 60


def test_a_link_that_recovers_is_tried_again():
    _, rate, link = simulate(100e3, 90.0, until=20.0)
    assert link.rate == 60
    assert rate >= 58


def test_a_page_that_answers_nothing_gets_few_frames():
    link, sent = Link(0.0), []
    for tick in range(10 * RATE):
        if link.is_due(tick, tick / RATE):
            link.note_sent(tick, tick / RATE)
            sent.append(tick)
    assert 10 <= len(sent) <= 50
    assert min(b - a for a, b in itertools.pairwise(sent)) >= STRIDES[-1]
