"""What the tables of an ablation say, whichever way their numbers fall."""

from __future__ import annotations

from resfit.eval.bench.ablation_sentences import (
    moves_sentences,
    optimizer_sentences,
    primitive_sentences,
    rounds_sentences,
)


def mean(iou: float, parts: float = 10.0, cpu: float = 2.0, overlap: float = 0.05) -> dict[str, float]:
    return {"iou": iou, "primitive_count": parts, "cpu_s": cpu, "overlap": overlap}


def test_families_and_unions() -> None:
    means = {
        "superfrustum, smooth": mean(0.95, 8.0, overlap=0.02),
        "superfrustum, hard": mean(0.94, 9.5, overlap=0.04),
        "cuboid, smooth": mean(0.8),
        "cuboid, hard": mean(0.81),
    }
    assert primitive_sentences(means) == [
        "Superfrustum, smooth has the highest mean IoU (95.00) and cuboid, smooth the lowest (80.00);"
        " superfrustum, smooth is 15.00 points of mean IoU above cuboid, smooth (95.00 against 80.00).",
        "Smooth instead of hard unions change mean IoU by +1.00 (superfrustum), -1.00 (cuboid) points, and the"
        " superfrustum's parts from 9.5 to 8.0 and overlap from 0.040 to 0.020.",
    ]


def test_rounds_and_decompositions() -> None:
    means = {
        "single shot, MSD": mean(0.90, 12.0),
        "ResFit, MSD": mean(0.93, 10.0, 3.0),
        "single shot, CoACD": mean(0.92, 20.0),
        "ResFit, CoACD": mean(0.91, 22.0, 4.0),
    }
    assert rounds_sentences(means) == [
        "Residual rounds instead of a single shot change mean IoU by +3.00 points with MSD (-2.0 parts) and"
        " -1.00 points with CoACD (+2.0 parts).",
        "ResFit, MSD is 2.00 points of mean IoU above ResFit, CoACD (93.00 against 91.00), with 10.0 parts against"
        " 22.0 and 3.0 CPU seconds against 4.0.",
    ]


def test_optimizers_that_are_as_good() -> None:
    means = {
        "Levenberg": mean(0.9),
        "Adam": mean(0.9, cpu=5.0),
        "Adam, learned sweep axis": mean(0.89, 11.0, 6.0),
    }
    assert optimizer_sentences(means) == [
        "Adam has the same mean IoU as Levenberg (90.00), with 10.0 parts against 10.0, in 2.5 times the CPU seconds.",
        "Learning the sweep axis changes Adam's mean IoU by -1.00 points, its parts by +1.0 and its CPU seconds by"
        " +1.0.",
    ]


def test_a_feature_whose_loss_gains_costs_nothing() -> None:
    everything = mean(0.9)
    costly = moves_sentences({"everything": everything, "no merges": mean(0.88), "no holes": mean(0.9, 13.0)})
    assert costly == [
        "Against everything (90.00), no merges costs most: mean IoU changes by no merges -2.00, no holes +0.00 points.",
        "The number of parts changes most with no holes: from 10.0 to 13.0, and overlap from 0.050 to 0.050.",
    ]
    gained = moves_sentences({"everything": everything, "no merges": mean(0.91)})
    assert gained[0].startswith("Against everything (90.00), no merges changes most: ")
