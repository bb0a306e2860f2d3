"""Conclusions of ablation tables, in two sentences each, made from their numbers whichever way they fall."""

from __future__ import annotations

from collections.abc import Mapping

Means = Mapping[str, Mapping[str, float]]
"""Mean of each column, by its key, of each row, by its label. IoU is in 0..1."""


def primitive_sentences(means: Means) -> list[str]:
    """Family x union: who leads, and what the smooth union changes. Labels are `family, union`."""
    order = sorted(means, key=lambda label: -means[label]["iou"])
    first, last = order[0], order[-1]
    ours, boxes = "superfrustum, smooth", "cuboid, smooth"
    lead = (
        f"{_capital(first)} has the highest mean IoU ({_percent(means[first])}) and {last} the lowest"
        f" ({_percent(means[last])}); {_against(means, ours, boxes)}."
    )
    families = list(dict.fromkeys(label.partition(",")[0] for label in means))
    changes = [
        f"{_points(means[f'{name}, smooth'], means[f'{name}, hard'])} ({name})"
        for name in families
        if f"{name}, smooth" in means and f"{name}, hard" in means
    ]
    smooth, hard = means[ours], means["superfrustum, hard"]
    return [
        lead,
        f"Smooth instead of hard unions change mean IoU by {', '.join(changes)} points, and the superfrustum's parts"
        f" from {hard['primitive_count']:.1f} to {smooth['primitive_count']:.1f} and overlap from"
        f" {hard['overlap']:.3f} to {smooth['overlap']:.3f}.",
    ]


def rounds_sentences(means: Means) -> list[str]:
    """Single shot or rounds x decomposition. Labels are `single shot|ResFit, MSD|CoACD`."""
    gains = []
    for decompose in ("MSD", "CoACD"):
        before, after = means[f"single shot, {decompose}"], means[f"ResFit, {decompose}"]
        parts = after["primitive_count"] - before["primitive_count"]
        gains.append(f"{_points(after, before)} points with {decompose} ({parts:+.1f} parts)")
    names = ("ResFit, MSD", "ResFit, CoACD")
    ours, pieces = (means[name] for name in names)
    return [
        f"Residual rounds instead of a single shot change mean IoU by {' and '.join(gains)}.",
        f"{_against(means, *names)}, with {ours['primitive_count']:.1f} parts against"
        f" {pieces['primitive_count']:.1f} and {ours['cpu_s']:.1f} CPU seconds against {pieces['cpu_s']:.1f}.",
    ]


def optimizer_sentences(means: Means) -> list[str]:
    """Levenberg, Adam, and Adam with a learned sweep axis."""
    second, first, learned = (means[label] for label in ("Levenberg", "Adam", "Adam, learned sweep axis"))
    times = first["cpu_s"] / max(second["cpu_s"], 1e-9)
    return [
        f"{_against(means, 'Adam', 'Levenberg')}, with {first['primitive_count']:.1f} parts against"
        f" {second['primitive_count']:.1f}, in {times:.1f} times the CPU seconds.",
        f"Learning the sweep axis changes Adam's mean IoU by {_points(learned, first)} points, its parts by"
        f" {learned['primitive_count'] - first['primitive_count']:+.1f} and its CPU seconds by"
        f" {learned['cpu_s'] - first['cpu_s']:+.1f}.",
    ]


def moves_sentences(means: Means) -> list[str]:
    """Everything, and one feature switched off a row."""
    whole = means["everything"]
    off = sorted((label for label in means if label != "everything"), key=lambda label: means[label]["iou"])
    worst = off[0]
    changes = ", ".join(f"{label} {_points(means[label], whole)}" for label in off)
    parts = max(off, key=lambda label: abs(means[label]["primitive_count"] - whole["primitive_count"]))
    lead = "costs" if _signed(means[worst], whole) < 0 else "changes"
    return [
        f"Against everything ({_percent(whole)}), {worst} {lead} most: mean IoU changes by {changes} points.",
        f"The number of parts changes most with {parts}: from {whole['primitive_count']:.1f} to"
        f" {means[parts]['primitive_count']:.1f}, and overlap from {whole['overlap']:.3f} to"
        f" {means[parts]['overlap']:.3f}.",
    ]


def _signed(a: Mapping[str, float], b: Mapping[str, float]) -> float:
    """Difference of the mean IoU in points, as it is shown."""
    return round(100.0 * a["iou"], 2) - round(100.0 * b["iou"], 2)


def _points(a: Mapping[str, float], b: Mapping[str, float]) -> str:
    return f"{_signed(a, b):+.2f}"


def _percent(mean: Mapping[str, float]) -> str:
    return f"{100.0 * mean['iou']:.2f}"


def _against(means: Means, name: str, other: str) -> str:
    a, b = means[name], means[other]
    difference = _signed(a, b)
    if abs(difference) < 0.005:
        return f"{name} has the same mean IoU as {other} ({_percent(a)})"
    side = "above" if difference > 0 else "below"
    return f"{name} is {abs(difference):.2f} points of mean IoU {side} {other} ({_percent(a)} against {_percent(b)})"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
