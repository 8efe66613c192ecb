import copy

import numpy as np
import pytest

import marl_airhockey as ah

pytest.importorskip("robosuite")

from marl_airhockey.sim.backends.robosuite.light_model import make_light
from marl_airhockey.sim.backends.robosuite.offscreen import (
    OffscreenRenderer,
    whole_table,
)


def test_light_model_has_few_faces_and_similar_images():
    world = ah.make_world("juggle", backend="robosuite")
    model, frame = world.backend.env.sim.model._model, world.backend.env.frame
    light = copy.copy(model)
    make_light(light)
    assert light.mesh_facenum.sum() < 0.2 * model.mesh_facenum.sum()
    qpos, images = world.backend.worlds[0].data.qpos, []
    for each in (model, light):
        try:
            renderer = OffscreenRenderer(each, frame, 320, 200)
        except RuntimeError as error:
            pytest.skip(str(error))
        images.append(renderer.picture(qpos, whole_table(each)).astype(int))
        renderer.close()
    assert images[0].std() > 20
    assert np.abs(images[0] - images[1]).mean() < 4
    world.close()
