"""Labels of results: as short as they can be and still differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from ellipsoid_coupling.models import find_kind
from ellipsoid_coupling.output.tables import print_table
from ellipsoid_coupling.result import Result


def model_name(model: str) -> str:
    """The label that a model declares; the name itself if no model is registered under it."""
    kind = find_kind(model)
    return model if kind is None else kind.label


def literal(text: str) -> str:
    """`text` for matplotlib, which reads text between two $ as mathematics."""
    return text.replace("$", r"\$")


def result_labels(results: Sequence[Result]) -> list[str]:
    """One label a result: the model; scheme, resolution, scene, flow, seed, number where labels repeat."""
    labels = [model_name(result.model) for result in results]
    additions = [
        [result.scheme for result in results],
        [str(result.attributes.get("resolution", "")) for result in results],
        [result.scene.name for result in results],
        flow_numbers(results),
        [f"seed {result.attributes.get('seed', '?')}" for result in results],
    ]
    for addition in additions:
        counts = Counter(labels)
        longer = [f"{label}, {text}" for label, text in zip(labels, addition, strict=True)]
        # An addition that all repeated labels share would only make them longer.
        if len(set(longer)) > len(set(labels)):
            pairs = zip(labels, longer, strict=True)
            labels = [long if counts[label] > 1 else label for label, long in pairs]
    counts = Counter(labels)
    numbered = enumerate(labels, 1)
    numbers = [f", run {k}" if counts[label] > 1 else "" for k, label in numbered]
    return [literal(label) + number for label, number in zip(labels, numbers, strict=True)]


def run_details(results: Sequence[Result]) -> list[str]:
    """What a figure says of each result besides its label: "rho: accurate, h = 0.01".

    Scheme, particles times realisations or cells, and step, unless the label has them.
    """
    return [
        f"{label}: {', '.join(parts)}" if parts else label
        for label, parts in zip(result_labels(results), _left_out(results), strict=True)
    ]


def long_labels(results: Sequence[Result]) -> list[str]:
    """The labels with a second line, the details of the run."""
    return [
        f"{label}\n{', '.join(parts)}" if parts else label
        for label, parts in zip(result_labels(results), _left_out(results), strict=True)
    ]


def _left_out(results: Sequence[Result]) -> list[list[str]]:
    """Scheme and resolution of each result, as far as its label does not name them."""
    parts = []
    for label, result in zip(result_labels(results), results, strict=True):
        both = (literal(result.scheme), literal(str(result.attributes.get("resolution", ""))))
        parts.append([part for part in both if part and part not in label])
    return parts


def flow_numbers(results: Sequence[Result]) -> list[str]:
    """Per result "flow 1", "flow 2", ...: different flows in the order in which they first occur."""
    digests = [str(result.attributes.get("flow_digest", "none")) for result in results]
    order = list(dict.fromkeys(digests))
    return [f"flow {1 + order.index(digest)}" for digest in digests]


def print_warnings(results: Sequence[Result]) -> None:
    """The warnings of completed runs (`Result.warnings`) as a table; nothing without warnings."""
    labels = result_labels(results)
    rows = [
        (label, line) for label, one in zip(labels, results, strict=True) for line in one.warnings
    ]
    if rows:
        print_table("Warnings of these runs", ("run", ""), rows)
