"""Wording of reports, where those of recordings and of tables differ."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Wording:
    """Words of one kind of report.

    Attributes
    ----------
    title : str
        Of the page, before the name of the input.
    command : str
        What made the report.
    subject : str
        What the input is; its key in ``report.json``.
    error : str
        What an error is relative to.
    floor : str
        What the floor of the errors is.
    intervals : str
        What the lines on the bars of the errors show.
    bands : str
        What the bands of a curve show.
    explained : str
        What share of what each effect that was tried explains.
    others : str
        What the keys of ``model.yaml`` are that are neither added nor nuisances.
    """

    title: str
    command: str
    subject: str
    error: str
    floor: str
    intervals: str
    bands: str
    explained: str
    others: str


OF_RECORDINGS = Wording(
    title="Diagnosis of",
    command="adv2e diagnose",
    subject="recording",
    error="as a share of the measured events: 0 is no difference, 1 as much as with no events",
    floor="two simulations of one model against each other; no model comes nearer",
    intervals="the middle 95 % of simulations",
    bands="the middle 95 % of simulations",
    explained="the share of the declared model's difference (the sum of squares of all numbers that"
    " were compared) that each alone takes away, on data that it was not fitted to",
    others="as declared",
)

OF_TABLES = Wording(
    title="Characterisation of",
    command="adv2e characterise",
    subject="table",
    error="of a natural logarithm: 0.1 is about 10 %",
    floor="the standard errors of the table's rows",
    intervals="the middle 95 %",
    bands="the middle 95 % of fits to tables drawn from the model",
    explained="the share of the declared model's error that each takes away, on light that it was"
    " not fitted to",
    others="as declared; what was not is off, or its default where a table cannot show it",
)
