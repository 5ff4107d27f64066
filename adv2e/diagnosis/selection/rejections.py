"""Why effects were not added to a model."""

from __future__ import annotations

from dataclasses import dataclass, field

from adv2e.diagnosis.fitting.fit import Fitted
from adv2e.reports.result import Rejected


@dataclass
class Rejections:
    """Why effects were not added: of each round, the reason of an effect's best form."""

    held: dict[str, Rejected] = field(default_factory=dict)
    _this_round: set[str] = field(default_factory=set)

    def new_round(self) -> None:
        """Let reasons take the place of earlier ones."""
        self._this_round.clear()

    def add(self, fit: Fitted, reason: str, *, final: bool = False) -> None:
        """Note why an effect was not taken; `final` reasons replace those of the same round."""
        name = fit.candidate.name
        if final or name not in self._this_round:
            self._this_round.add(name)
            self.held[name] = Rejected(name, reason, fit.parameters)
