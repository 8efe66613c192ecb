"""Cameras whose frames are observed: that of the virtual lab, or of a rig."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from marl_airhockey.sim.contracts.backend import Backend, LiveBackend
from marl_airhockey.sim.contracts.camera_model import CameraModel, lab_camera
from marl_airhockey.sim.contracts.image_form import (
    CameraForm,
    image_form,
    shows_camera,
)
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.table import TABLES, Table


def camera_models(
    forms: Iterable[str], scene: Scene, backend: Backend | None = None
) -> dict[str, CameraModel]:
    """Return the cameras of the observation types that show one.

    Args:
        forms: Observation types.
        scene: Scene on the table.
        backend: Backend. A real table has a camera of its own.

    Raises:
        ValueError: The file of a rig is not valid, or describes another table.
    """
    shown = {form: image_form(form) for form in forms if shows_camera(form)}
    if isinstance(backend, LiveBackend):
        return dict.fromkeys(shown, backend.camera_model)
    return {
        form: _rig_camera(form, settings.rig, scene.table)
        for form, settings in shown.items()
        if isinstance(settings, CameraForm)
    }


def _rig_camera(form: str, rig: str, table: Table) -> CameraModel:
    """Return the camera of a rig, by its file; "" for the camera of the virtual lab."""
    if not rig:
        return lab_camera(table)
    from marl_airhockey.hardware.rig import Rig

    try:
        known = Rig.load(Path(rig))
    except ValueError as error:
        raise ValueError(f"observe: {form!r}: {error}") from error
    if TABLES[known.table] != table:
        raise ValueError(
            f"observe: {form!r}: the scenario's table is not the rig's "
            f'{known.table!r}; pass options={{"table": "{known.table}"}}'
        )
    return known.camera_model
