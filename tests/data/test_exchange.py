"""Recordings as datasets of others: LeRobot, the authors' HDF5, rows; and back."""

import csv
import json

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

import marl_airhockey as ah
from marl_airhockey.cli.main import app
from marl_airhockey.data.exchange.formats import FORMATS, find_format, import_dataset
from marl_airhockey.data.exchange.lerobot import export_lerobot, table_image
from marl_airhockey.data.exchange.settings import ImportSettings
from marl_airhockey.data.exchange.trajectories import (
    FIELDS,
    FULL,
    OFFSET,
    export_trajectories,
)
from marl_airhockey.data.reader import read_recording
from marl_airhockey.data.record import record_episodes
from marl_airhockey.data.relabel import relabelled
from marl_airhockey.registry import make_driver, make_scenario
from marl_airhockey.sim.core.recording import FILM
from marl_airhockey.sim.render.renderer import Renderer

pd = pytest.importorskip("pandas")
pq = pytest.importorskip("pyarrow.parquet")
h5py = pytest.importorskip("h5py")
av = pytest.importorskip("av")


def recorded(folder, scenario="reach", driver="reacher", episodes=3, **keywords):
    path = folder / "recording"
    agent = make_driver(driver)
    return record_episodes(agent, driver, scenario, episodes, path, 0, keywords)


def settings_for(source, scenario, out, **more):
    return ImportSettings(str(source), scenario, out, **more)


def all_rows(episode, name):
    return np.concatenate([episode.first[name][None], episode.columns[name]])


@pytest.mark.parametrize("goals", [{}, {"goals": "dict"}])
def test_lerobot_dataset_comes_back_as_it_was_written(tmp_path, goals):
    path = recorded(tmp_path, **goals)
    folder = export_lerobot([path], "reach", tmp_path / "sets")
    again = import_dataset(settings_for(folder, "reach", tmp_path / "again"))
    before, after = read_recording(path), read_recording(again)
    for name in ("scenario", "options", "profile", "observe", "control_dt"):
        assert after.head[name] == before.head[name]
    for one, two in zip(before.episodes, after.episodes, strict=True):
        shown = [n for n in one.first if n.startswith("observation")]
        assert shown == [n for n in two.first if n.startswith("observation")]
        for name in shown:
            assert np.array_equal(all_rows(one, name), all_rows(two, name))
        for name in ("action", "reward"):
            single = one.columns[name].astype(np.float32)
            assert np.array_equal(two.columns[name], single), name
        for name in ("success", "terminated", "truncated"):
            assert np.array_equal(one.columns[name], two.columns[name]), name


def test_lerobot_dataset_is_read_by_pyarrow_and_pandas_alone(tmp_path):
    path = recorded(tmp_path)
    folder = export_lerobot([path], "reach", tmp_path / "sets")
    info = json.loads((folder / "meta/info.json").read_text())
    episodes = read_recording(path).episodes
    lengths = [len(episode) for episode in episodes]
    assert info["codebase_version"] == "v3.0"
    assert info["fps"] == 20
    assert info["total_frames"] == sum(lengths)
    file = info["data_path"].format(chunk_index=0, file_index=0)
    table = pq.ParquetFile(folder / file)
    assert [table.metadata.row_group(k).num_rows for k in range(3)] == lengths
    frames = table.read().to_pandas()
    for name, feature in info["features"].items():
        size = 1 if feature["shape"] == [1] else len(frames[name].iloc[0])
        assert [size] == feature["shape"], name
        assert feature["names"] is None or len(feature["names"]) == size
    assert (frames["index"] == np.arange(len(frames))).all()
    assert np.allclose(frames["timestamp"], frames["frame_index"] / 20)
    rows = pq.read_table(folder / "meta/episodes").to_pandas()
    assert rows["length"].tolist() == lengths
    assert rows["dataset_to_index"].tolist() == np.cumsum(lengths).tolist()
    assert pd.read_parquet(folder / "meta/tasks.parquet").iloc[0].name
    stats = json.loads((folder / "meta/stats.json").read_text())
    actions = np.stack(frames["action"])
    assert np.allclose(stats["action"]["mean"], actions.mean(0))
    assert np.allclose(stats["action"]["q10"], np.quantile(actions, 0.1, axis=0))


@pytest.mark.parametrize("seat", [0, 1])
def test_lerobot_has_the_action_chosen_sent_and_applied(tmp_path, seat):
    keywords = {"drivers": {"paddle_1": "striker"}, "profile": "ur5e"}
    path = recorded(tmp_path, "duel", "striker", 1, max_cycles=40, **keywords)
    folder = export_lerobot([path], "duel", tmp_path / "sets", seat)
    frames = pd.read_parquet(folder / "data")
    columns = read_recording(path).episodes[0].columns
    for name in ("action", "applied_action"):
        single = columns[name][:, seat].astype(np.float32)
        np.testing.assert_array_equal(np.stack(frames[name]), single)
    sent = np.stack(frames["sent_action"])
    ours = make_scenario("duel").scene
    rotation = ours.table.rotation(ours.seats[seat].side)
    speed = read_recording(path).episodes[0].physics["paddle_speed"]
    np.testing.assert_allclose(
        sent, columns["command"][:, seat] @ rotation.T / speed, rtol=1e-5, atol=1e-6
    )
    assert np.abs(np.stack(frames["action"]) - sent).max() > 0.05


def test_lerobot_has_the_times_of_a_real_table(tmp_path):
    path = recorded(tmp_path, episodes=2)
    for name, late in (("captured", -0.05), ("received", -0.02), ("moment", 0.0)):
        add_column(path, f"device.{name}", "float64", lambda k, _, t=late: 1e5 + k + t)
    add_column(path, "device.applied", "float64", lambda k, _: 1e5 + k - 0.9)
    folder = export_lerobot([path], "reach", tmp_path / "sets")
    frames = pd.read_parquet(folder / "data")
    number = frames["frame_index"] + 1e5
    # Before a step; the action of the step is applied afterwards.
    np.testing.assert_allclose(frames["captured_time"], number - 0.05)
    np.testing.assert_allclose(frames["received_time"], number - 0.02)
    np.testing.assert_allclose(frames["observed_time"], number)
    np.testing.assert_allclose(frames["applied_time"], number + 0.1)


def test_lerobot_video_shows_the_newest_picture_of_each_step(tmp_path):
    path = recorded(tmp_path, episodes=2)
    code = cv2.VideoWriter.fourcc(*"MJPG")
    film = cv2.VideoWriter(str(path / FILM), code, 30, (64, 48))
    for level in range(0, 250, 20):
        film.write(np.full((48, 64, 3), level, np.uint8))
    film.release()
    _add_frames(path, [0, 1, 1, 3, 4])
    folder = export_lerobot([path], "reach", tmp_path / "sets")
    info = json.loads((folder / "meta/info.json").read_text())
    name = "observation.images.table"
    assert info["features"][name]["shape"] == [48, 64, 3]
    file = info["video_path"].format(video_key=name, chunk_index=0, file_index=1)
    video, levels = cv2.VideoCapture(str(folder / file)), []
    while (read := video.read())[0]:
        levels.append(int(read[1].mean().round()))
    length = len(read_recording(path).episodes[1])
    wanted = [20 * k for k in [0, 1, 1, 3, *[4] * (length - 4)]]
    assert np.abs(np.array(levels) - wanted).max() < 10, "the nearest level"
    stats = json.loads((folder / "meta/stats.json").read_text())[name]
    assert np.array(stats["mean"]).shape == (3, 1, 1)


def test_lerobot_images_show_the_table_before_each_step(tmp_path):
    path = recorded(tmp_path, episodes=2)
    folder = export_lerobot([path], "reach", tmp_path / "sets", images=True)
    info = json.loads((folder / "meta/info.json").read_text())
    name = "observation.images.table"
    height, width, _ = info["features"][name]["shape"]
    assert width == 224
    assert "observation.environment_state" not in info["features"]
    file = info["video_path"].format(video_key=name, chunk_index=0, file_index=1)
    video, shown = cv2.VideoCapture(str(folder / file)), []
    while (read := video.read())[0]:
        shown.append(read[1][..., ::-1])
    (_, episode) = read_recording(path).episodes
    assert len(shown) == len(episode)
    env = ah.gym_env("reach", "rgb_array")
    env.reset(seed=1)
    renderer = Renderer(env.world, "rgb_array", "")
    for image, action in zip(shown, episode.columns["action"][:, 0], strict=True):
        expected = table_image(renderer)
        assert expected.shape == (height, width, 3)
        assert np.abs(image.astype(int) - expected).mean() < 3.0
        env.step(action)


def grey_film(path, count):
    """Write the film of a recording, of so many pictures."""
    code = cv2.VideoWriter.fourcc(*"MJPG")
    film = cv2.VideoWriter(str(path / FILM), code, 30, (64, 48))
    for _ in range(count):
        film.write(np.full((48, 64, 3), 90, np.uint8))
    film.release()


def test_an_episode_whose_film_ends_before_it_is_named_and_left_out(tmp_path):
    path = recorded(tmp_path, episodes=2)
    _add_frames(path, [0, 1, 1, 3, 4], later=5)
    grey_film(path, 8)
    result = CliRunner().invoke(app, ["data", "check", str(path)])
    assert result.exit_code == 1
    assert "episode 1: the video ends 2 frames before the episode" in result.output
    assert "1 good episodes, 1 faults" in result.output
    with pytest.warns(RuntimeWarning, match="episode 1: .* left out"):
        folder = export_lerobot([path], "reach", tmp_path / "sets")
    info = json.loads((folder / "meta/info.json").read_text())
    assert info["total_episodes"] == 1
    grey_film(path, 3)
    with (
        pytest.warns(RuntimeWarning, match="left out"),
        pytest.raises(ValueError, match="the video ends before every episode"),
    ):
        export_lerobot([path], "none", tmp_path / "sets")


def test_an_exported_video_has_a_codec_that_browsers_play(tmp_path):
    path = recorded(tmp_path, episodes=1)
    _add_frames(path, [0, 1, 1, 3, 4])
    grey_film(path, 5)
    folder = export_lerobot([path], "reach", tmp_path / "sets")
    info = json.loads((folder / "meta/info.json").read_text())
    name = "observation.images.table"
    assert info["features"][name]["info"]["video.codec"] == "h264"
    (file,) = (folder / "videos").rglob("*.mp4")
    with av.open(str(file)) as video:
        assert video.streams.video[0].codec_context.name == "h264"


def add_column(path, name, dtype, values_of):
    """Give all steps a column, a function of their numbers and their episodes."""
    meta = json.loads((path / "meta.json").read_text())
    meta["columns"][name] = {"dtype": dtype, "shape": []}
    (path / "meta.json").write_text(json.dumps(meta))
    for part in (path / "steps").iterdir():
        table = pq.read_table(part)
        numbers = (table[key].to_numpy() for key in ("step", "episode"))
        values = values_of(*numbers).astype(dtype)
        pq.write_table(table.append_column(name, [values.tolist()]), part)


def _add_frames(path, numbers, later=0):
    """Give the steps of each episode the numbers of pictures, the last one on.

    Those of each episode begin ``later`` after those of the one before.
    """

    def shown(step, episode):
        return np.array(numbers)[np.minimum(step, len(numbers) - 1)] + later * episode

    add_column(path, "frame", "int64", shown)


def made_file(path, columns=35, robot_frame=False, inverted=False, rows=40):
    """Write a file as the paper's authors describe theirs; return its rows."""
    rng = np.random.default_rng(7)
    time = 1.7e9 + 0.05 * np.arange(rows)
    pose = np.full((rows, 6), (-0.5, 0.0, 0.3, 0.0, -3.06, 0.0))
    pose[:, :2] += 0.1 * np.sin(time[:, None] - time[0] + (0.0, 1.0))
    target = pose.copy()
    target[:, :2] += rng.uniform(-0.1, 0.1, (rows, 2))
    puck = np.column_stack([np.linspace(-0.7, 0.3, rows), np.zeros(rows)])
    hidden = np.arange(rows) % 7 == 3
    for k in np.flatnonzero(hidden):
        puck[k] = puck[k - 1]
    parts = {
        "time": time[:, None],
        "trajectory": np.full((rows, 1), 4.0),
        "step": np.arange(rows)[:, None],
        "emergency_stop": np.zeros((rows, 1)),
        "safe": np.ones((rows, 1)),
        "pose": pose,
        "speed": rng.normal(size=(rows, 6)),
        "force": rng.normal(size=(rows, 6)),
        "acceleration": rng.normal(size=(rows, 3)),
        "target_pose": target,
        "puck": np.column_stack([puck - (OFFSET * robot_frame, 0), hidden ^ inverted]),
    }
    missing = {35: (), 32: ("puck",), 31: ("safe", "puck"), "old": ("safe", "puck")}
    kept = [parts[n] for n in FIELDS if n not in missing[columns]]
    more = [np.zeros((rows, 1))] if columns == "old" else []
    values = np.concatenate(kept + more, 1)
    with h5py.File(path, "w") as file:
        file["train_vals"] = values
        file["train_img"] = np.zeros((rows, 24, 32, 3), np.uint8)
    return values, parts, puck, hidden


@pytest.mark.parametrize("columns", [35, 32, 31, "old"])
def test_authors_trajectories_come_back_as_they_were(tmp_path, columns):
    source = tmp_path / "trajectory_data7.hdf5"
    values, parts, *_ = made_file(source, columns)
    path = import_dataset(
        settings_for(source, "juggle", tmp_path / "new", options={"table": "full_size"})
    )
    (episode,) = read_recording(path).episodes
    assert episode.columns["robot.force"].shape == (39, 6)
    paddle = all_rows(episode, "state.position")[:, 0]
    assert np.allclose(paddle, -parts["pose"][:, :2] - (OFFSET, 0.0))
    gap = parts["target_pose"][:-1, :2] - parts["pose"][:-1, :2]
    assert np.allclose(episode.columns["action"][:, 0], np.clip(-gap / FULL, -1, 1))
    folder = export_trajectories([path], "again", tmp_path)
    with h5py.File(folder / "trajectory_data0.hdf5") as file:
        assert np.array_equal(file["train_vals"], values)


@pytest.mark.parametrize("robot_frame", [False, True])
@pytest.mark.parametrize("inverted", [False, True])
def test_puck_of_authors_files_is_found_in_either_frame(
    tmp_path, robot_frame, inverted
):
    source = tmp_path / "trajectory_data7.hdf5"
    *_, puck, hidden = made_file(source, 35, robot_frame, inverted)
    path = import_dataset(settings_for(source, "touch", tmp_path / "new"))
    (episode,) = read_recording(path).episodes
    seen = all_rows(episode, "sensed.visible")[:, 0]
    assert np.array_equal(seen, ~hidden)
    found = all_rows(episode, "state.position")[:, 1]
    assert np.allclose(found[seen], -puck[seen])
    assert np.diff(found[:, 0]).max() < 0.0, "gaps are interpolated"


def test_simulated_recording_is_exported_as_the_authors_label_it(tmp_path):
    path = recorded(tmp_path, "touch", "still", 1)
    folder = export_trajectories([path], "sets", tmp_path)
    (episode,) = read_recording(path).episodes
    with h5py.File(folder / "trajectory_data0.hdf5") as file:
        values = np.array(file["train_vals"])
    assert values.shape == (len(episode) + 1, 35)
    again = import_dataset(settings_for(folder, "touch", tmp_path / "again"))
    (back,) = read_recording(again).episodes
    for name in ("state.position", "action"):
        assert np.allclose(back.columns[name], episode.columns[name], atol=1e-12)


def test_imported_trajectories_are_relabelled_for_tasks(tmp_path):
    source = tmp_path / "trajectory_data7.hdf5"
    made_file(source, 35)
    path = import_dataset(
        settings_for(source, "juggle", tmp_path / "new", options={"table": "full_size"})
    )
    new = read_recording(relabelled(path, "touch", tmp_path / "touch"))
    (episode,) = new.episodes
    assert episode.columns["observation"].shape[0] == len(episode)
    assert np.isfinite(episode.columns["observation"]).all()


def test_rows_of_a_table_come_back_as_they_were(tmp_path):
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.008, 0.009, 60))
    puck, paddle = rng.uniform(-0.3, 0.3, (2, 60, 2))
    rows = np.column_stack([time, puck, paddle]).tolist()
    for k in (5, 6, 30, 59):
        rows[k][1:3] = "", ""
    source = tmp_path / "rows.csv"
    with source.open("w", newline="") as file:
        csv.writer(file).writerows([["t", "x", "y", "paddle_x", "paddle_y"], *rows])
    path = import_dataset(settings_for(source, "touch", tmp_path / "new"))
    (episode,) = read_recording(path).episodes
    assert np.flatnonzero(~all_rows(episode, "sensed.visible")[:, 0]).tolist() == [
        *(5, 6, 30, 59)
    ]
    folder = find_format("rows").export([path], "again", tmp_path, 0)
    with (folder / "episode-00000.csv").open() as file:
        header, *written = csv.reader(file)
    assert header == ["t", "x", "y", "paddle_x", "paddle_y"]
    assert written == [[str(cell) for cell in row] for row in rows]


def test_rows_without_a_paddle_come_back_without_one(tmp_path):
    source = tmp_path / "rows.csv"
    source.write_text("t,x,y\n0.0,0.1,0.2\n0.01,0.11,0.2\n0.02,0.12,0.2\n")
    path = import_dataset(settings_for(source, "touch", tmp_path / "new"))
    folder = find_format("rows").export([path], "again", tmp_path, 0)
    assert (folder / "episode-00000.csv").read_text() == source.read_text()


def test_contacts_of_measured_play_are_found_again(tmp_path):
    path = recorded(tmp_path, "juggle", "zoo/juggle", 10)
    folder = find_format("rows").export([path], "rows", tmp_path, 0)
    measured = import_dataset(settings_for(folder, "juggle", tmp_path / "measured"))
    again = relabelled(measured, "juggle", tmp_path / "again")
    old, new = (read_recording(p).episodes for p in (path, again))
    for one, two in zip(old, new, strict=True):
        touched = [e.columns["state.touched"][:, 0, 0] for e in (one, two)]
        assert abs(int(touched[0].sum()) - int(touched[1].sum())) <= 1
        assert one.columns["success"][-1] == two.columns["success"][-1]
        speed = np.abs(one.columns["state.velocity"] - two.columns["state.velocity"])
        assert np.median(speed) < 0.05


def test_truncated_lerobot_dataset_is_refused(tmp_path):
    path, out = recorded(tmp_path, episodes=4), tmp_path / "new"
    folder = export_lerobot([path], "reach", tmp_path / "sets")
    part = folder / "data/chunk-000/file-000.parquet"
    table = pq.ParquetFile(part).read()
    length = len(read_recording(path).episodes[-1])
    for rows, words in (
        (len(table) - 1, "episode 3: frames are missing"),
        (len(table) - length, r"episodes are missing: \[3\]"),
        (0, "episodes are missing"),
    ):
        pq.write_table(table.slice(0, rows), part)
        with pytest.raises(ValueError, match=words):
            import_dataset(settings_for(folder, "reach", out))
    for name in ("action", "next.done", "frame_index", "episode_index"):
        pq.write_table(table.drop_columns([name]), part)
        with pytest.raises(ValueError, match=f"the column '{name}' is missing"):
            import_dataset(settings_for(folder, "reach", out))
    texts = table.drop_columns(["next.reward"])
    pq.write_table(texts.append_column("next.reward", [["a"] * len(table)]), part)
    with pytest.raises(ValueError, match=r"column 'next\.reward'"):
        import_dataset(settings_for(folder, "reach", out))
    info = folder / "meta/info.json"
    for text, words in (
        ("[1]", "expected an object"),
        ('{"codebase_version": 1}', "v3"),
    ):
        info.write_text(text)
        with pytest.raises(ValueError, match=words):
            import_dataset(settings_for(folder, "reach", out))
    assert not out.exists()


@pytest.mark.parametrize("name", ["../out", "/tmp/out", "", "a//b", "a b"])
@pytest.mark.parametrize("form", ["lerobot", "hdf5", "rows"])
def test_names_of_datasets_stay_in_their_folder(tmp_path, form, name):
    path = recorded(tmp_path, "touch", "still", 1)
    with pytest.raises(ValueError, match="--name"):
        find_format(form).export([path], name, tmp_path / "sets", 0)
    assert not (tmp_path / "sets").exists()


@pytest.mark.parametrize("form", FORMATS)
def test_seats_that_are_not_there_are_refused(tmp_path, form):
    path = recorded(tmp_path, "touch", "still", 1)
    with pytest.raises(ValueError, match="--seat 3"):
        find_format(form).export([path], "touch/x-v0", tmp_path / "sets", 3)
    assert not [*tmp_path.rglob(".part*")]


def test_folder_that_cannot_be_made_is_named(tmp_path):
    path = recorded(tmp_path, "touch", "still", 1)
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="cannot be created"):
        find_format("rows").export([path], "x", tmp_path / "file", 0)
    with pytest.raises(ValueError, match="cannot be created"):
        relabelled(path, "touch", tmp_path / "file" / "x")


def test_source_of_no_known_format_is_named(tmp_path):
    (tmp_path / "other").mkdir()
    with pytest.raises(ValueError, match="not a LeRobot dataset"):
        import_dataset(settings_for(tmp_path / "other", "touch", tmp_path / "new"))


BAD_ROWS = {
    "column 'y' is missing": "t,x\n0,1\n",
    "'abc'; expected a number": "t,x,y\n0,1,abc\n",
    "times must increase|increasing times": "t,x,y\n0,0,0\n",
    r"0\.5 s follows 1\.0 s": "t,x,y\n0,0,0\n1,0,0\n0.5,0,0\n",
    "line 3: 1 cells; expected 3": "t,x,y\n0,0,0\n1\n",
    "row 1: the puck at .* is off the table": "t,x,y\n0,0,0\n1,300,0\n",
    "never detected": "t,x,y\n0,,\n1,,\n",
    "a time is missing": "t,x,y\n,0,0\n1,0,0\n",
}


@pytest.mark.parametrize("words", BAD_ROWS)
def test_bad_rows_are_named_and_leave_nothing(tmp_path, words):
    source = tmp_path / "rows.csv"
    source.write_text(BAD_ROWS[words])
    with pytest.raises(ValueError, match=words) as error:
        import_dataset(settings_for(source, "touch", tmp_path / "new"))
    assert "rows.csv" in str(error.value)
    assert not (tmp_path / "new").exists()


def test_bad_trajectories_are_named_and_leave_nothing(tmp_path):
    source = tmp_path / "trajectory_data0.hdf5"
    out = tmp_path / "new"
    for values, words in (
        (np.zeros((5, 20)), "expected at least two rows of 35 or 32 or 31 columns"),
        (np.zeros((1, 35)), "expected at least two rows"),
        (np.full((5, 35), np.nan), "row 0 is not finite"),
        (np.zeros((5, 35)), "times must increase"),
    ):
        with h5py.File(source, "w") as file:
            file["train_vals"] = values
        with pytest.raises(ValueError, match=words):
            import_dataset(settings_for(source, "touch", out))
    with h5py.File(source, "w") as file:
        file["other"] = np.zeros(3)
    with pytest.raises(ValueError, match="no train_vals"):
        import_dataset(settings_for(source, "touch", out))
    source.write_text("no hdf5")
    with pytest.raises(ValueError, match="cannot be read"):
        import_dataset(settings_for(source, "touch", out))
    made_file(source)
    with pytest.raises(ValueError, match="one paddle and one puck"):
        import_dataset(settings_for(source, "duel", out))
    assert not out.exists()


def test_bad_lerobot_datasets_are_named_and_leave_nothing(tmp_path):
    path, out = recorded(tmp_path), tmp_path / "new"
    folder = export_lerobot([path], "reach", tmp_path / "sets")
    with pytest.raises(ValueError, match="the folder exists"):
        export_lerobot([path], "reach", tmp_path / "sets")
    with pytest.raises(ValueError, match="--seat 4"):
        export_lerobot([path], "other", tmp_path / "sets", 4)
    assert not list((tmp_path / "sets").glob(".part*"))
    with pytest.raises(ValueError, match="observations have the shape"):
        import_dataset(settings_for(folder, "juggle", out))
    info = folder / "meta/info.json"
    content = json.loads(info.read_text())
    info.write_text(json.dumps({**content, "codebase_version": "v2.1"}))
    with pytest.raises(ValueError, match=r"version 'v2.1'; expected 'v3.0'"):
        import_dataset(settings_for(folder, "reach", out))
    del content["features"]["next.reward"]
    info.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=r"'next.reward' is missing"):
        import_dataset(settings_for(folder, "reach", out))
    info.write_text("no json")
    with pytest.raises(ValueError, match="cannot be read"):
        import_dataset(settings_for(folder, "reach", out))
    assert not out.exists()


@pytest.mark.parametrize("form", ["hdf5", "rows"])
def test_recording_without_a_puck_is_refused(tmp_path, form):
    with pytest.raises(ValueError, match="there is no puck in reach"):
        find_format(form).export([recorded(tmp_path)], "set", tmp_path, 0)
    assert not (tmp_path / "set").exists()


def test_unknown_format_is_refused():
    with pytest.raises(ValueError, match="format 'csv'"):
        find_format("csv")
    assert [*FORMATS] == ["lerobot", "hdf5", "rows", "minari"]
