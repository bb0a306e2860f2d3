"""The steps of a fit's history: their order, who is who in them, and that they end in the result."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playback_fits import small_fit
from viewer_scenes import need_drawing, primitive

from resfit.assembly.assembly import Assembly
from resfit.assembly.history import History, HistoryRound
from resfit.assembly.transform import Transform
from resfit.errors import InputError
from resfit.kernels.rows import ROW
from resfit.viewer.playback.interpolate import mixed, tween
from resfit.viewer.playback.playback import GREY, Frame, load_playback, matches, playback, region_boxes

STAGES = ["regions", "candidates", "chosen", "refined"]


@pytest.fixture(scope="module")
def frames() -> tuple[Frame, ...]:
    fit = small_fit()
    return load_playback(fit.folder, fit.assembly)


def box_row(x: float, size: float = 0.4) -> np.ndarray:
    part = primitive("cuboid", "box", (x, 0.0, 0.0))
    return replace(part, parameters={**part.parameters, "size": (size, size, size)}).row()


def made_round(
    candidates: list, chosen: list, kept: list, accepted: bool = True, source: str = "block"
) -> HistoryRound:
    """A round that refines nothing."""
    rows = [np.array(given, np.float32).reshape(-1, ROW) for given in (candidates, chosen, chosen, kept)]
    region = {"source": source, "volume": 8, "resolution": 4, "lower": [0, 0, 1], "upper": [2, 4, 2]}
    return HistoryRound((region,), *rows, {"volume_iou": 0.5, "objective": 0.4}, accepted)


def test_the_last_step_is_the_result_as_it_is(frames) -> None:
    assembly = small_fit().assembly
    assert frames[-1].stage == "final"
    assert frames[-1].assembly.to_json() == assembly.to_json()
    assert (frames[-1].assembly.rows() == assembly.rows()).all()
    iou = json.loads((small_fit().folder / "report.json").read_text())["metrics"]["iou"]
    assert f"{len(assembly.primitives)} parts · IoU {iou:.3f}" == frames[-1].detail


def test_steps_are_those_of_the_history_in_order(frames) -> None:
    history = History.load(small_fit().folder / "history.npz")
    assert len(frames) == 5 * len(history.rounds) + 1
    rounds = [frame.round for frame in frames]
    assert rounds == sorted(rounds) and set(rounds) == set(range(1, len(history.rounds) + 1))
    for number, entry in enumerate(history.rounds):
        steps = frames[5 * number : 5 * number + 5]
        assert [step.stage for step in steps] == [*STAGES, "kept" if entry.accepted else "rejected"]
        assert len(steps[0].boxes) == len(entry.regions)
        for step, rows in zip(steps[2:], (entry.chosen, entry.refined, entry.kept), strict=True):
            assert (step.assembly.rows() == rows).all()
        assert f"Round {number + 1} of {len(history.rounds)}" in steps[0].title


def test_parts_keep_their_names_and_those_of_the_result_have_its_colours(frames) -> None:
    final = {part.name: part.color for part in frames[-1].assembly.primitives}
    chosen, refined, kept = frames[2:5]
    names = [part.name for part in chosen.assembly.primitives]
    assert [part.name for part in refined.assembly.primitives] == names
    assert {part.name for part in kept.assembly.primitives} <= set(names)
    named = {part.name for frame in frames[:-1] for part in frame.assembly.primitives} & set(final)
    assert named
    for frame in frames[:-1]:
        if frame.stage != "rejected":
            assert all(p.color == final[p.name] for p in frame.assembly.primitives if p.name in final)


def test_only_candidates_that_were_not_there_are_new(frames) -> None:
    history = History.load(small_fit().folder / "history.npz")
    assert len(frames[1].faint) == len(history.rounds[0].candidates)
    assert all(len(frame.faint) == 0 for frame in frames if frame.stage != "candidates")


def test_tracks_rejections_and_beginnings() -> None:
    a, b, c = box_row(-0.5), box_row(0.5), box_row(0.0, 0.9)
    rounds = (
        made_round([a, b], [a], [a], source="solid"),
        made_round([a, b], [a, b], [a, b]),
        made_round([c], [a, b, c], [a, c], accepted=False),
        # Another track begins from nothing; a third goes on from what the first came to.
        made_round([c], [c], [c], source="solid"),
        made_round([c], [a, b], [a, b]),
    )
    final = Assembly.from_rows(np.stack([a, b]), ["cuboid"] * 2, ["#112233", "#445566"])
    frames = playback(History("cuboid", Transform(), rounds), final)
    assert [frame.stage for frame in frames[4::5]] == ["kept", "kept", "rejected", "kept", "kept"]
    assert {part.color for part in frames[14].assembly.primitives} == {GREY}
    assert "rejected" in frames[14].title
    starts = [len(frame.assembly.primitives) for frame in frames[0:25:5]]
    assert starts == [0, 1, 2, 0, 2]
    assert [k for k, frame in enumerate(frames) if "a new beginning" in frame.title] == list(range(15, 20))
    for at in (6, 9, 10, 20, 24):
        for part, name in zip(frames[at].assembly.primitives, ("part_00", "part_01"), strict=False):
            assert part.name == name, at


def test_a_fit_without_rounds_is_its_result() -> None:
    final = Assembly.from_rows(box_row(0.0)[None], ["cuboid"], ["#112233"])
    (frame,) = playback(History("cuboid", Transform()), final, 0.75)
    assert frame.assembly is final
    assert frame.detail.startswith("1 part · IoU 0.750")


def test_a_history_of_another_fit_is_refused(tmp_path: Path) -> None:
    final = Assembly.from_rows(box_row(0.0)[None], ["cuboid"], ["#112233"])
    with pytest.raises(InputError, match=r"holds no history\.npz"):
        load_playback(tmp_path, final)
    History("cuboid", Transform(2.0)).save(tmp_path / "history.npz")
    with pytest.raises(InputError, match="another fit"):
        load_playback(tmp_path, final)


def test_regions_are_boxes_of_the_normalised_frame() -> None:
    region = {"source": "block", "resolution": 4, "lower": [0, 0, 1], "upper": [2, 4, 2]}
    boxes = region_boxes([region, {"source": "unknown"}])
    np.testing.assert_allclose(boxes, [[[-1.0, -1.0, -0.5], [0.0, 1.0, 0.0]]])


def test_matches_are_near_in_place_and_size() -> None:
    rows = np.stack([box_row(-0.5), box_row(0.5), box_row(0.0, 0.9)])
    others = np.stack([box_row(0.55), box_row(-0.5)])
    pairs, closeness = matches(rows, others, "superfrustum")
    assert sorted(pairs) == [(0, 1), (1, 0)]
    assert closeness > 0.0
    assert matches(rows, rows[:0], "superfrustum") == ([], 0.0)


def test_between_steps_parts_move_grow_and_shrink() -> None:
    old, new = (
        primitive("superfrustum", "a", (0.0, 0.0, 0.0)),
        primitive("superfrustum", "a", (1.0, 0.0, 0.0)),
    )
    gone, come = primitive("cuboid", "gone", (0.0, 1.0, 0.0)), primitive("cuboid", "come", (0.0, 2.0, 0.0))
    before, after = (Frame("kept", 1, "", "", Assembly(parts)) for parts in ((old, gone), (new, come)))
    half = {part.name: part for part in tween(before, after, 0.5).assembly.primitives}
    assert half["a"].pose.translation == (0.5, 0.0, 0.0)
    for name, whole in (("gone", gone), ("come", come)):
        np.testing.assert_allclose(half[name].parameters["size"], 0.5 * np.array(whole.parameters["size"]))
    assert tween(before, after, 1.0) is after
    assert [p.name for p in tween(before, after, 0.0).assembly.primitives] == ["a", "gone"]
    # A turn and its negative quaternion are the same.
    w, x, y, z = new.pose.rotation
    turned = replace(new, pose=replace(new.pose, rotation=(-w, -x, -y, -z)))
    assert mixed(new, turned, 0.5).pose.matrix() == pytest.approx(new.pose.matrix())


def test_player_steps_plays_and_follows(frames) -> None:
    need_drawing()
    from resfit.viewer.playback.playback_scene import StepScene
    from resfit.viewer.playback.player import FOOT, MARGIN, Player
    from resfit.viewer.scene.plotter import make_plotter

    plotter = make_plotter((320, 240), off_screen=True)
    try:
        player = Player(plotter, StepScene(plotter, frames[-1].assembly), frames[:-1])
        for key, at in (
            ("Right", 1),
            ("Left", 0),
            ("Left", 0),
            ("End", len(frames) - 2),
            ("Right", len(frames) - 2),
        ):
            player.press(key)
            assert player.at == at
        player.draw()
        player.add(frames[-1])
        assert player.at == len(frames) - 1
        player.draw()
        assert player.scene.session.state.assemblies[0] is frames[-1].assembly
        player.press("Home")
        player.add(frames[-1])
        assert player.at == 0
        player.press(" ")
        player._next = 0.0
        player.tick()
        assert (player.at, player.playing) == (1, True)
        for x, at in ((MARGIN, 0), (320 - MARGIN, len(frames))):
            player.interactor.SetEventInformation(x, FOOT // 2, 0, 0, "\0", 0, None)
            player.interactor.LeftButtonPressEvent()
            player.interactor.LeftButtonReleaseEvent()
            assert player.at == at
        player.press("m")
        player.press("j")
        player.draw()
        player.press("q")
        assert player.closing
    finally:
        plotter.close()
