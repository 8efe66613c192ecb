"""Labs that are opened at the same time."""

import threading

import pytest

from marl_airhockey.hardware.lab.lab import Lab


@pytest.mark.slow
def test_labs_that_open_at_once_have_addresses_of_their_own():
    pytest.importorskip("rtde_control")
    labs = []
    threads = [threading.Thread(target=lambda: labs.append(Lab())) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    try:
        assert len({lab.host for lab in labs}) == 2
        assert all(all(lab.alive) for lab in labs)
    finally:
        for lab in labs:
            lab.close()
