"""Films: how many pictures, what is in them, and what is refused."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playback_fits import run_cli, small_fit
from viewer_scenes import need_drawing

from resfit.errors import InputError
from resfit.viewer.model.edit_session import EditSession
from resfit.viewer.playback.film import eased, frame_at
from resfit.viewer.playback.playback import load_playback
from resfit.viewer.playback.video import write_film
from resfit.viewer.scene.camera import OrbitCamera

SIZE = (160, 120)


def pictures_of(path: Path) -> list[np.ndarray]:
    """All pictures of a GIF, (height, width, 3) uint8."""
    with Image.open(path) as film:
        found = []
        for k in range(film.n_frames):
            film.seek(k)
            found.append(np.array(film.convert("RGB")))
    return found


def silhouette(picture: np.ndarray) -> np.ndarray:
    """(height, width) bool, what is coloured, captions left out."""
    spread = picture.max(axis=2).astype(int) - picture.min(axis=2)
    return (spread > 40)[: -SIZE[1] // 20]


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / max(1, (a | b).sum()))


def film(path: Path, *options: str, size: str = "160x120") -> int:
    return run_cli("view", small_fit().folder, "--video", path, "--size", size, "--device", "cpu", *options)


def test_gif_of_a_fit_ends_in_the_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    need_drawing()
    path = tmp_path / "fit.gif"
    small_fit()
    capsys.readouterr()
    assert film(path, "--seconds", "2.5", "--fps", "8") == 0
    assert capsys.readouterr().out == f"{path}: optimisation\n"
    assert [entry.name for entry in tmp_path.iterdir()] == ["fit.gif"]
    pictures = pictures_of(path)
    assert len(pictures) == 20
    assert all(picture.shape == (SIZE[1], SIZE[0], 3) for picture in pictures)
    assert all((a != b).any() for a, b in pairwise(pictures))
    with Image.open(path) as opened:
        durations = []
        for k in range(opened.n_frames):
            opened.seek(k)
            durations.append(opened.info["duration"])
    assert sum(durations) == 2500
    assert overlap(silhouette(pictures[-1]), silhouette(rendered_result())) > 0.9
    assert overlap(silhouette(pictures[0]), silhouette(rendered_result())) < 0.5


def rendered_result() -> np.ndarray:
    """The result seen as at the end of a film."""
    from resfit.viewer.playback.film import stand_back
    from resfit.viewer.scene.plotter import make_plotter
    from resfit.viewer.scene.scene import Scene
    from resfit.viewer.scene.screenshot import grab

    plotter = make_plotter(SIZE, off_screen=True)
    try:
        stand_back(Scene(plotter, EditSession([small_fit().assembly]), camera=OrbitCamera(), device="cpu"))
        return grab(plotter)
    finally:
        plotter.close()


@pytest.mark.parametrize("motion", ["explode", "turntable"])
def test_gifs_without_a_history_move_and_come_back(motion: str, tmp_path: Path) -> None:
    need_drawing()
    path = tmp_path / "film.gif"
    assert film(path, "--motion", motion, "--seconds", "1", "--fps", "9") == 0
    shapes = [silhouette(picture) for picture in pictures_of(path)]
    assert all(0.02 < shape.mean() < 0.8 for shape in shapes)
    middle = shapes[len(shapes) // 2]
    assert overlap(shapes[0], middle) < 0.9
    if motion == "explode":
        assert (shapes[0] == shapes[-1]).all()
        assert middle.any(axis=0).sum() > shapes[0].any(axis=0).sum()
    # Nothing is cut off.
    assert not any(shape[:, [0, -1]].any() for shape in shapes)


# imageio-ffmpeg leaves the pipes of what it has read to the collector.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_mp4_can_be_read_again(tmp_path: Path) -> None:
    need_drawing()
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the package imageio-ffmpeg is not installed")
    path = tmp_path / "film.mp4"
    assert film(path, "--motion", "turntable", "--seconds", "0.8", "--fps", "10", size="161x121") == 0
    reader = ffmpeg.read_frames(str(path))
    facts = next(reader)
    assert facts["size"] == SIZE and facts["fps"] == 10.0
    pictures = [np.frombuffer(data, np.uint8).reshape(SIZE[1], SIZE[0], 3) for data in reader]
    assert len(pictures) == 8
    assert all(silhouette(picture).mean() > 0.02 for picture in pictures)


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("film.avi", (), "must end in .gif or .mp4"),
        ("missing/film.gif", (), "there is no folder"),
        ("film.gif", ("--fps", "90"), "--fps 90 is out of range"),
        ("film.gif", ("--seconds", "0"), "--seconds 0 "),
        ("film.gif", ("--seconds", "9000"), "2 to 3600 pictures"),
    ],
)
def test_films_that_cannot_be_are_refused_in_a_sentence(
    name: str, options: tuple[str, ...], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert film(tmp_path / name, *options) == 2
    complaint = capsys.readouterr().err
    assert says in complaint and complaint.count("\n") == 1
    assert film(tmp_path / "film.gif", size="4x4") == 2
    assert "--size 4x4" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_without_a_history_there_is_no_film_of_the_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small_fit().assembly.save(tmp_path / "assembly.json")
    options = ("--video", tmp_path / "film.gif", "--motion", "optimisation", "--size", "64x64")
    assert run_cli("view", tmp_path, *options) == 2
    assert "history.npz" in capsys.readouterr().err
    assert run_cli("view", tmp_path, "--play") == 2
    assert "history.npz" in capsys.readouterr().err


def test_mp4_without_its_package_names_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert film(tmp_path / "film.mp4") == 2
    assert "-m pip install 'imageio-ffmpeg>=" in capsys.readouterr().err


def test_nothing_half_written_stays(tmp_path: Path) -> None:
    def broken(k: int) -> np.ndarray:
        if k == 3:
            raise InputError("no more.")
        return np.full((16, 16, 3), 40 * k, np.uint8)

    for name in ("film.gif", "film.mp4"):
        (tmp_path / name).write_bytes(b"earlier")
        if name.endswith("mp4"):
            pytest.importorskip("imageio_ffmpeg", reason="the package imageio-ffmpeg is not installed")
        with pytest.raises(InputError, match="no more"):
            write_film(tmp_path / name, broken, 5, 10.0)
        assert (tmp_path / name).read_bytes() == b"earlier"
    assert len(list(tmp_path.iterdir())) == 2


def test_steps_of_a_film_come_in_order_and_end_in_the_result() -> None:
    frames = load_playback(small_fit().folder, small_fit().assembly)
    shown = [frame_at(frames, share) for share in np.linspace(0.0, 1.0, 400)]
    titles = list(dict.fromkeys(frame.title for frame in shown))
    assert titles == list(dict.fromkeys(frame.title for frame in frames))
    assert shown[0] is frames[0] and shown[-1] is frames[-1]
    assert sum(frame.stage == "final" for frame in shown) > 40
    assert [eased(share) for share in (-1.0, 0.0, 0.5, 1.0, 2.0)] == [0.0, 0.0, 0.5, 1.0, 1.0]
