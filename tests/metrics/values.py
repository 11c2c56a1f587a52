"""Samples of metrics by name and labels."""

from prometheus_client.core import Metric

Values = dict[tuple[str, frozenset[tuple[str, str]]], float]


def flat(families: list[Metric]) -> Values:
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in families
        for sample in family.samples
    }


def names(found: Values) -> set[str]:
    return {name for name, _ in found}
