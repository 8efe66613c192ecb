"""CSV files of real tables with the rows `t,x,y[,paddle_x,paddle_y]`.

There is one file for each episode. Times are in s and positions in m, in the table
frame. A cell is empty if the body was not detected. `airhockey fit-table` also reads
such files.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from marl_airhockey.data.exchange.measured import (
    Measured,
    interpolated,
    measured_head,
    recorded_scenario,
    scenario_for,
    write_measured,
)
from marl_airhockey.data.exchange.seats import (
    all_rows,
    check_seat,
    episodes_with_steps,
)
from marl_airhockey.data.exchange.settings import ImportSettings
from marl_airhockey.data.files import named_folder, shared_head, whole_folder
from marl_airhockey.data.writer import whole_recording
from marl_airhockey.rollouts.columns import SENSED, STATE
from marl_airhockey.sim.core.recording import PLAYED, Columns, Episode
from marl_airhockey.types import Array

PUCK, PADDLE = ("t", "x", "y"), ("paddle_x", "paddle_y")
"""Names of the columns of a file; the columns of the paddle are optional."""
MOMENT = "device.moment"
"""Column of the measured times, s."""
SEEN = "paddle_visible"
"""Column that is true where the paddle was detected."""


def import_rows(settings: ImportSettings) -> Path:
    """Write CSV files of positions, one per episode, as a recording; return its path.

    Missing positions are interpolated. A paddle without columns is at the centre of its
    workspace.

    Raises:
        ValueError: There are no files, a column is missing, or a cell is not a number.
    """
    scenario, path = scenario_for(settings), Path(settings.source)
    files = sorted(path.glob("*.csv")) if path.is_dir() else [path]
    if not files:
        raise ValueError(f"{path}: it contains no *.csv files")
    tables = [(file, read_rows(file)) for file in files]
    steps = np.concatenate([np.diff(rows[:, 0]) for _, rows in tables])
    control_dt = round(float(np.median(steps)), 6) if len(steps) else 0.0
    if not control_dt > 0:
        raise ValueError(
            f"{files[0]}: expected at least two rows with increasing times"
        )
    seat = scenario.scene.seats[0]
    centre = np.mean(seat.reach, 0) @ scenario.scene.table.rotation(seat.side)
    with whole_recording(settings.out, measured_head(settings, control_dt)) as writer:
        for file, rows in tables:
            time, paddle = rows[:, 0], rows[:, 3:5]
            seen = np.asarray(np.isfinite(paddle).all(1))
            place = np.tile(centre, (len(time), 1))
            if seen.any():
                place = interpolated(time, paddle, seen)
            found = Measured(time, rows[:, 1:3], place)
            more: Columns = {MOMENT: time, SEEN: seen}
            try:
                write_measured(writer, scenario, found, more, PLAYED)
            except ValueError as error:
                raise ValueError(f"{file}: {error}") from error
    return settings.out


def read_rows(file: Path) -> Array:
    """Return the rows (T, 5) of a file, s and m, table frame; nan for empty cells.

    Raises:
        ValueError: The file cannot be read, a column is missing, or a cell is not a
            number.
    """
    try:
        with file.open(newline="") as opened:
            reader = csv.reader(opened, skipinitialspace=True)
            header = [name.strip() for name in next(reader, ())]
            missing = [name for name in PUCK if name not in header]
            if missing:
                raise ValueError(
                    f"{file}: column {missing[0]!r} is missing; the first line must be "
                    "t,x,y, optionally with paddle_x,paddle_y"
                )
            rows = [_row(file, reader.line_num, header, cells) for cells in reader]
    except FileNotFoundError as error:
        raise ValueError(f"{file}: this file does not exist") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{file}: cannot be read: {error}") from error
    found = np.array(rows).reshape(-1, 5)
    if not np.isfinite(found[:, 0]).all():
        raise ValueError(f"{file}: a time is missing")
    return found


def _row(file: Path, line: int, header: list[str], cells: list[str]) -> list[float]:
    """Return the numbers (5,) of a row; nan for missing columns."""
    if len(cells) != len(header):
        raise ValueError(
            f"{file}, line {line}: {len(cells)} cells; expected {len(header)}, with "
            "empty cells for a body that was not detected"
        )
    row = dict(zip(header, cells, strict=True))
    return [_number(file, line, row.get(name)) for name in (*PUCK, *PADDLE)]


def _number(file: Path, line: int, cell: str | None) -> float:
    try:
        return float(cell) if cell and cell.strip() else np.nan
    except ValueError:
        raise ValueError(f"{file}, line {line}: {cell!r}; expected a number") from None


def export_rows(
    files: Sequence[Path], name: str, root: Path | None = None, seat: int | None = 0
) -> Path:
    """Write positions of puck and paddle as CSV files; return their folder.

    The positions are true in simulation, and measured on a real table.

    Raises:
        ValueError: The folder exists, no seat is given, there is no puck, or recordings
            have different environments or no steps.
    """
    if seat is None:
        raise ValueError("--seat -1: the rows have one paddle; give its seat")
    recorded_scenario(files[0], shared_head(files))
    final = named_folder(root, name)
    with whole_folder(final) as folder:
        for k, (_, episode) in enumerate(episodes_with_steps(files)):
            check_seat(episode, seat)
            _write(folder / f"episode-{k:05d}.csv", episode, seat)
    return final


def _write(file: Path, episode: Episode, seat: int) -> None:
    known = episode.columns
    time = MOMENT if MOMENT in known else STATE + "time"
    names = [time, STATE + "position"]
    measured = SEEN in known
    if measured:
        names += [SEEN, f"{SENSED}visible"]
    parts = [all_rows(episode, name) for name in names]
    pucks = known["action"].shape[1]
    paddle, puck = parts[1][:, seat].copy(), parts[1][:, pucks].copy()
    if measured:
        paddle[~parts[2]], puck[~parts[3][:, 0]] = np.nan, np.nan
    header = PUCK if np.isnan(paddle).all() else (*PUCK, *PADDLE)
    with file.open("w", newline="") as opened:
        writer = csv.writer(opened, lineterminator="\n")
        writer.writerow(header)
        for row in np.column_stack([parts[0], puck, paddle])[:, : len(header)].tolist():
            writer.writerow(["" if np.isnan(x) else repr(x) for x in row])
