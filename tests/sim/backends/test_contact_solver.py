"""Pushes of contacts: complementary, symmetric in the bodies, no work for nothing."""

import itertools

import numpy as np
import pytest

from marl_airhockey.sim.backends.numba.bodies import (
    ASKS,
    BODY,
    CONTACT,
    MASS,
    NX,
    PRESCRIBED,
    PUCK,
    VX,
    VY,
)
from marl_airhockey.sim.backends.numba.complementarity import complement
from marl_airhockey.sim.backends.numba.contact_solver import ALL, PADDLES, push
from marl_airhockey.sim.jit.cache import compiled

complement, push = map(compiled(error_model="numpy"), (complement, push))


def solved(matrix, right):
    n = len(right)
    tableau = np.ones((n, n + 2))
    tableau[:, :n], tableau[:, n + 1] = matrix, right
    found = complement(tableau, np.zeros(2 * n + 1, np.int64), n)
    return tableau[:, 0].copy() if found else None


@pytest.mark.parametrize("n", [1, 2, 3, 6, 12])
@pytest.mark.parametrize("rank", [1.0, 0.5])
def test_solutions_are_complementary(n, rank):
    rng = np.random.default_rng(n)
    for _ in range(200):
        # As contacts have it: rows of fewer unknowns than contacts are redundant.
        rows = rng.normal(size=(n, max(1, round(n * rank))))
        rows /= np.linalg.norm(rows, axis=-1, keepdims=True)
        right = rows @ rng.normal(size=rows.shape[1])
        z = solved(rows @ rows.T, right)
        w = rows @ rows.T @ z + right
        assert z.min() >= 0.0
        assert w.min() > -1e-8
        assert abs(z @ w) < 1e-7


def test_what_has_no_solution_is_said():
    # A puck between two paddles that come nearer.
    assert solved(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([-1.0, -1.0])) is None
    assert (
        solved(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([-1.0, 1.0])) is not None
    )


def row_of(roles, velocities, *places):
    """Bodies along x, each in contact with the next; paddles have the first numbers."""
    m, order = np.zeros((len(roles), BODY)), places or range(len(roles))
    m[:, VX] = velocities
    m[:, MASS] = [30.0 if role == PUCK else 0.0 for role in roles]
    pairs, contacts = [], np.zeros((len(roles) - 1, CONTACT))
    for contact, (left, right) in zip(contacts, itertools.pairwise(order), strict=True):
        pairs.append((min(left, right), max(left, right)))
        contact[NX] = 1.0 if left < right else -1.0
    return m, np.array(roles), np.array(pairs), contacts


def test_paddles_that_meet_share_their_velocity():
    m, role, pairs, contacts = row_of([ASKS, ASKS, ASKS], [3.0, 0.0, 0.0])
    assert push(m, role, VX, pairs, contacts, 2, PADDLES)
    np.testing.assert_allclose(m[:, VX], 1.0)
    m, role, pairs, contacts = row_of([ASKS, PRESCRIBED], [3.0, -1.0])
    assert push(m, role, VX, pairs, contacts, 1, PADDLES)
    np.testing.assert_allclose(m[:, VX], -1.0)


def test_what_parts_is_not_pushed():
    m, role, pairs, contacts = row_of([PRESCRIBED, PUCK, PUCK], [2.0, 0.0, 5.0])
    assert push(m, role, VX, pairs, contacts, 2, ALL)
    np.testing.assert_allclose(m[:, VX], [2.0, 2.0, 5.0])


def test_a_puck_without_room_stops_paddles_that_ask():
    m, role, pairs, contacts = row_of([ASKS, ASKS, PUCK], [2.0, -1.0, 0.0], 0, 2, 1)
    assert push(m, role, VX, pairs, contacts, 2, ALL)
    # All three count alike.
    np.testing.assert_allclose(m[:, VX], 1.0 / 3.0)


def test_a_puck_between_prescribed_paddles_cannot_be_helped():
    roles = [PRESCRIBED, PRESCRIBED, PUCK]
    m, role, pairs, contacts = row_of(roles, [1.0, -1.0, 0.0], 0, 2, 1)
    assert not push(m, role, VX, pairs, contacts, 2, ALL)
    np.testing.assert_allclose(m[:, VX], [1.0, -1.0, 0.0])
    assert (m[:, VY] == 0.0).all()
