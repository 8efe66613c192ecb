import time
from contextlib import closing

import pytest

from marl_airhockey.hardware.calibration.lab_rig import calibrate_lab
from marl_airhockey.hardware.lab.lab import Lab, LabClient, served


@pytest.fixture(scope="package")
def lab():
    """A lab that runs, found by nobody else."""
    pytest.importorskip("rtde_control")
    with Lab() as opened:
        yield opened


@pytest.fixture(scope="package")
def rig(lab, tmp_path_factory):
    """The file of its rig, calibrated by what its camera shows."""
    path = tmp_path_factory.mktemp("lab") / "rig.json"
    with served(lab, announce=False) as port:
        with closing(LabClient(port)) as client:
            calibrate_lab(client).save(path)
        yield path


@pytest.fixture(autouse=True)
def puck_in_sight(request):
    """Place the puck where the arm does not hide it, whatever was tested before."""
    if "lab" in request.fixturenames:
        lab = request.getfixturevalue("lab")
        lab.ask({"do": "place", "puck": [0.3, 0.0], "velocity": [0.0, 0.0]})
        time.sleep(0.2)


@pytest.fixture
def fault(lab):
    """Switch a fault on; all are off afterwards."""
    on = []

    def switch(name):
        on.append(name)
        lab.ask({"do": "fault", "name": name, "on": True})

    yield switch
    for name in on:
        lab.ask({"do": "fault", "name": name, "on": False})
    # Frames are on their way for a moment.
    time.sleep(0.1 if on else 0.0)
