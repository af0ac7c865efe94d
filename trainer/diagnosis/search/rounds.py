"""The rounds of a search: one cause after the other, each in a model that has those before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.core.site import Site
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.freerun import LogDays
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge
from igrow.trainer.diagnosis.learned.null_gains import NullGains, read_null_gains, read_unknown_gains
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search import cross_validation, history, parameter_change, unexplained
from igrow.trainer.diagnosis.search.change import Round, changed
from igrow.trainer.diagnosis.search.estimate import Estimated, estimate, with_refitted, within_bounds
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange
from igrow.trainer.diagnosis.search.refit import refit
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.solver import DivergenceError


@dataclass(frozen=True)
class Search:
    """The rounds of a search: one cause after the other, each in a model that has those before it.

    A large effect moves the model far from where the search linearised it; further causes and what remains can
    be told only after it has been put in. For the same reason the first may have stood in for a later one: where that
    is more surely there than all before it, the search begins again with it (forward and backward steps: Zhang 2009,
    Advances in Neural Information Processing Systems 21).
    """

    days: LogDays
    site: Site
    knowledge: Knowledge
    without: frozenset[str]
    rules: DecisionRules
    history: Discrepancy
    plain: Design
    """The log without any cause, before any noise."""
    misfit: Floats | None
    """What the model is expected to miss in this log, (b, r, steps); None of a greenhouse that no calibration shows."""
    null_gains: NullGains
    """Of greenhouses in which nothing has changed."""
    is_unlike: bool = False
    """More is gained here where nothing has changed than in the weeks that this was learned of."""
    by_days: bool = True
    """Unseen days alone may tell something; not in weeks or of leaves unlike those that null skills were learned of."""
    unnamed: tuple[Hypothesis, ...] = field(default=(), kw_only=True)
    """Patterns that no cause explains, found before: the model has them."""
    _latest: list[tuple[list[ActiveTerm], Design]] = field(default_factory=list)
    """Terms that the log was laid out with last: it is asked in two ways, and laid out once."""

    def run(self, rng: np.random.Generator, earlier: Sequence[Estimated] = ()) -> tuple[Round, Round, list[Estimated]]:
        """Return the first and the last round, and the causes that were found.

        Args:
            rng: for flips and bootstraps.
            earlier: causes that the weeks before this log have told: found already.
        """
        design = self.design(())
        first: Round | None = None
        found = list(earlier)
        if found:
            first = self.judge(design, [], rng, causes=True)
            design = self.design(found)
        # What weeks before have told gives way to nothing.
        led = set(EFFECTS if earlier else ())
        asked = self
        while True:
            judged = asked.judge(design, found, rng, causes=len(found) < self.rules.most_causes)
            first = first or judged
            new = estimate(judged, rng)
            if new is None:
                further = asked.beside(judged.patterns)
                if further is None:
                    return first, replace(judged, patterns=(*asked.unnamed, *judged.patterns)), found
                asked = further
                design = asked.design(found)
                continue
            terms = self.joined_by(new, judged, found, led)
            if not terms:
                # It only mops up what is left; another may be there.
                asked, terms = replace(asked, without=asked.without | {new.effect}), found
            try:
                design = asked.design(terms)
            except DivergenceError:
                # No cause: the log itself stayed within all bounds.
                return first, replace(judged, patterns=asked.unnamed), found
            found = terms

    def judge(self, design: Design, found: Sequence[Estimated], rng: np.random.Generator, *, causes: bool) -> Round:
        """Return what one round finds; where time steps tell nothing, or not which, unseen days are asked.

        Args:
            design: of the log, with the causes found before as terms.
            found: these.
            rng: for flips and bootstraps.
            causes: look for a cause, and not for patterns only.
        """
        more = len(self.unnamed) < self.rules.most_patterns
        judged = changed(design, sum(one.gain for one in found), rng, causes=causes, patterns=more)
        by_physics = self.knowledge.by_physics(self.rules)
        if judged.patterns:
            return cross_validation.clearest(design, by_physics, judged, rng)
        if not causes:
            return judged
        if judged.cause is not None:
            judged = cross_validation.settled(design, by_physics, judged, rng)
        if judged.cause is None and self.by_days and not self.is_unlike:
            judged = cross_validation.find(design, by_physics, rng) or judged
        if judged.cause is None:
            return judged
        return cross_validation.with_what_outdoes_it(design, by_physics, judged, rng)

    def design(self, causes: Sequence[Estimated]) -> Design:
        """Return the design of the log by a model that has causes."""
        return self._expected(self._laid_out(causes))

    def beside(self, patterns: Sequence[Hypothesis]) -> Search | None:
        """Return the search for causes beside patterns: a greenhouse that is unlike its calibration can break as well.

        What a change gains where nothing breaks is not known of such a greenhouse: only what gains far more is told.
        """
        if not patterns:
            return None
        return replace(self, unnamed=(*self.unnamed, *patterns), is_unlike=True)

    def history_after(self, causes: Sequence[Estimated]) -> Discrepancy | None:
        """Return the history that has seen this log too, with the causes that stand in it; None where there is none."""
        if self.knowledge.history is None:
            return None
        return history.after(self.history, self.design(causes))

    def changed_parameter(self, rng: np.random.Generator) -> ParameterChange | None:
        """Return the parameter that has changed where no effect is missing; None where nobody knows what it was.

        The vents' law counts as known here also where it may be off: what it explains no other is to stand in for.
        """
        if self.knowledge.history is None:
            return None
        surely = replace(self._laid_out(()), rules=replace(self.rules, vent_drift=self.rules.wall_drift))
        return parameter_change.find(self._expected(surely), rng)

    def unexplained(self, rng: np.random.Generator) -> tuple[Hypothesis, ...]:
        """Return the patterns that unseen days tell where nothing else is told, one of each kind."""
        if not self.by_days or self.is_unlike:
            return ()
        return unexplained.find(self.design(()), self.site.longitude, self.knowledge.by_physics(self.rules), rng)

    def joined_by(self, new: Estimated, judged: Round, found: Sequence[Estimated], led: set[str]) -> list[Estimated]:
        """Return the causes of the next model: none where a further one adds nothing of its own.

        One that only mops up what is left runs to its bound, or has no size that is sure; one that is confounded with
        another (two ways for CO2 to leak in) leaves neither with one. One beside which those before it hardly stand is
        alone to begin with.

        Args:
            new: that a round has found.
            judged: this round.
            found: in rounds before.
            led: effects that were first before, and are not again; those that give way now join them.
        """
        terms = self.refitted(judged, [*found, new])
        if found and new.effect not in led and terms[-1].certainty > max(one.certainty for one in terms[:-1]):
            led.update(one.effect for one in found)
            terms = self.refitted(judged, [new])
        stand = all(one.term.amplitude != 0.0 for one in terms)
        if len(terms) > 1:
            sure = all(one.certainty >= self.rules.least_certainty for one in terms)
            stand = stand and sure and all(_is_inside(one, judged.design) for one in terms[1:])
        return terms if stand else []

    def refitted(self, judged: Round, causes: Sequence[Estimated]) -> list[Estimated]:
        """Return causes refitted together."""
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                found = refit(judged.design, judged.named, [one.term for one in causes], self.knowledge.terms)
        except (np.linalg.LinAlgError, DivergenceError):
            # A poor start can run away; the causes then stay as the search found them.
            return [within_bounds(one, judged.design) for one in causes]
        return [with_refitted(one, two, self.rules) for one, two in zip(causes, found, strict=True)]

    def _expected(self, laid_out: Design) -> Design:
        null_gains = self.null_gains.times(self.rules.far_over_null if self.is_unlike else 1.0)
        unnamed = {one.key for one in self.unnamed}
        return history.expected(self.history, laid_out, self.misfit, self.without, null_gains, unnamed)

    def _laid_out(self, causes: Sequence[Estimated]) -> Design:
        terms = [*self.knowledge.terms, *(one.term for one in causes)]
        if not terms:
            return self.plain
        if not self._latest or self._latest[0][0] != terms:
            self._latest[:] = [(terms, history.laid_out(self.days, self.site, self.history, terms, self.rules))]
        return self._latest[0][1]


def search_of(
    days: LogDays,
    site: Site,
    knowledge: Knowledge,
    without: frozenset[str],
    rules: DecisionRules,
    null_gains: NullGains | None = None,
    *,
    is_later: bool = False,
    by_days: bool = True,
) -> Search:
    """Return the search in a log: for what has changed since the calibration, or for what was never known.

    What a change must gain was learned from the weeks next to a calibration. In later ones a season makes more of what
    a calibration misses, so that only what gains far more is told (`is_later`), and nothing that unseen days alone tell
    (`by_days`). In a greenhouse that no calibration has shown a cause has bounds of its own, and unseen days alone tell
    nothing either.
    """
    known = knowledge.history
    if known is None:
        known, gains = history.unknown(days, site, knowledge, rules), null_gains or read_unknown_gains()
        plain = history.laid_out(days, site, known, (), rules)
        return Search(days, site, knowledge, without, rules, known, plain, None, gains, by_days=False)
    gains = null_gains or read_null_gains()
    plain = history.laid_out(days, site, known, (), rules)
    misfit = history.expected_misfit(known, plain)
    return Search(days, site, knowledge, without, rules, known, plain, misfit, gains, is_later, by_days)


def _is_inside(one: Estimated, design: Design) -> bool:
    """Tell whether a cause lies inside its bounds."""
    low, high = design.amplitude_bounds(one.effect, one.hypothesis.term.onset)
    amplitude = one.term.amplitude
    return amplitude < high and (low == 0.0 or amplitude > low)
