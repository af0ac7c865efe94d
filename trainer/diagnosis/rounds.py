"""The rounds of a search: one cause after the other, each in a model that has those before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.core.site import Site
from igrow.trainer.diagnosis import cross_validation, history, parameter_change, unexplained
from igrow.trainer.diagnosis.change import changed
from igrow.trainer.diagnosis.compare import Round, compare
from igrow.trainer.diagnosis.design import Design, prepare
from igrow.trainer.diagnosis.estimate import Estimated, estimate, with_refitted, within_bounds
from igrow.trainer.diagnosis.freerun import LogDays
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, activate
from igrow.trainer.diagnosis.nuisance import NuisanceSubspace, read_nuisance
from igrow.trainer.diagnosis.null_gains import NullGains, read_null_gains
from igrow.trainer.diagnosis.parameter_change import ParameterChange
from igrow.trainer.diagnosis.refit import refit
from igrow.trainer.diagnosis.rules import HOUR, DecisionRules
from igrow.trainer.diagnosis.search import Hypothesis
from igrow.trainer.diagnosis.structure import disagreement
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
    nuisance: NuisanceSubspace
    unnamed: tuple[Hypothesis, ...] = field(default=(), kw_only=True)
    """Patterns that no cause explains, found before: the model has them."""

    def run(self, rng: np.random.Generator, earlier: Sequence[Estimated] = ()) -> tuple[Round, Round, list[Estimated]]:
        """Return the first and the last round, and the causes that were found.

        Args:
            rng: for flips and bootstraps.
            earlier: causes that the weeks before this log have told: found already.
        """
        design = self.resolved()
        first: Round | None = None
        found = list(earlier)
        if found:
            first = self.judge(design, [], rng, causes=True)
            design = self.design([*self.knowledge.terms, *(one.term for one in found)], design.interval)
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
                design = asked.design([*self.knowledge.terms, *(one.term for one in found)], design.interval)
                continue
            terms = self.joined_by(new, judged, found, led)
            if not terms:
                # It only mops up what is left; another may be there.
                asked, terms = replace(asked, without=asked.without | {new.effect}), found
            try:
                design = asked.design([*self.knowledge.terms, *(one.term for one in terms)], design.interval)
            except DivergenceError:
                # No cause: the log itself stayed within all bounds.
                return first, replace(judged, patterns=asked.unnamed), found
            found = terms

    def beside(self, _patterns: Sequence[Hypothesis]) -> Search | None:
        """Return the search for causes beside patterns; None where there is none."""
        return None

    def history_after(self, _causes: Sequence[Estimated]) -> Discrepancy | None:
        """Return None: there is no history."""
        return None

    def changed_parameter(self, _rng: np.random.Generator) -> ParameterChange | None:
        """Return nothing: without a history nobody knows what a parameter was."""
        return None

    def unexplained(self, _rng: np.random.Generator) -> tuple[Hypothesis, ...]:
        """Return nothing: what a calibration elsewhere misses here is a pattern as well."""
        return ()

    def judge(self, design: Design, found: Sequence[Estimated], rng: np.random.Generator, *, causes: bool) -> Round:
        """Return what one round finds beside the causes found before, which the design has as terms."""
        return compare(design, _explained(found), rng, causes=causes)

    def design(self, terms: Sequence[ActiveTerm], interval: float) -> Design:
        """Return the design of a model with terms; what usually differs stands in where its structure does not."""
        hours = interval >= HOUR
        record, split, known = self.days.record, self.days.split, self.knowledge
        return prepare(
            record, split, known.short_prior, activate(record, terms), self.site.longitude, self.rules,
            discrepancy=known.discrepancy,
            directions=self.nuisance.directions(transferred=known.transferred) if hours else (),
            null_amplitude=self.nuisance.null_amplitude(split.days, self.rules) if hours else {},
            without=self.without,
            interval=interval,
        )  # fmt: skip

    def resolved(self) -> Design:
        """Return the first design: by time steps where the model's structure is the greenhouse's, else by hours."""
        hours = self.design(self.knowledge.terms, HOUR)
        if self.days.record.step >= HOUR:
            return hours
        steps = self.design(self.knowledge.terms, self.days.record.step)
        return steps if disagreement(hours, steps) <= self.rules.largest_disagreement else hours

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


@dataclass(frozen=True)
class Change(Search):
    """The same in a greenhouse whose history is known: what has changed in it since."""

    history: Discrepancy
    plain: Design
    """The log without any cause, before any noise."""
    misfit: Floats
    """What the model is expected to miss in this log."""
    null_gains: NullGains
    """Of greenhouses in which nothing has changed."""
    is_unlike: bool = False
    """More is gained here where nothing has changed than in the weeks that this was learned of."""
    by_days: bool = True
    """Unseen days alone may tell something; not in weeks or of leaves unlike those that null skills were learned of."""
    _latest: list[tuple[list[ActiveTerm], Design]] = field(default_factory=list)
    """Terms that the log was laid out with last: it is asked in two ways, and laid out once."""

    def judge(self, design: Design, found: Sequence[Estimated], rng: np.random.Generator, *, causes: bool) -> Round:
        """Return what one round finds; where time steps tell nothing, or not which, unseen days are asked."""
        more = len(self.unnamed) < self.rules.most_patterns
        judged = changed(design, _explained(found), rng, causes=causes, patterns=more)
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

    def design(self, terms: Sequence[ActiveTerm], interval: float) -> Design:
        """Return the design of a model with terms, about the calibrated parameters."""
        return self._expected(self._laid_out(list(terms)))

    def beside(self, patterns: Sequence[Hypothesis]) -> Search | None:
        """Return the search for causes beside patterns: a greenhouse that is unlike its calibration can break as well.

        What a change gains where nothing breaks is not known of such a greenhouse: only what gains far more is told.
        """
        if not patterns:
            return None
        return replace(self, unnamed=(*self.unnamed, *patterns), is_unlike=True)

    def history_after(self, causes: Sequence[Estimated]) -> Discrepancy | None:
        """Return the history that has seen this log too, with the causes that stand in it."""
        terms = [*self.knowledge.terms, *(one.term for one in causes)]
        return history.after(self.history, self.design(terms, self.days.record.step))

    def changed_parameter(self, rng: np.random.Generator) -> ParameterChange | None:
        """Return the parameter that has changed where no effect is missing.

        The vents' law counts as known here also where it may be off: what it explains no other is to stand in for.
        """
        plain = self._laid_out(list(self.knowledge.terms))
        surely = replace(plain, rules=replace(self.rules, vent_drift=self.rules.wall_drift))
        return parameter_change.find(self._expected(surely), rng)

    def unexplained(self, rng: np.random.Generator) -> tuple[Hypothesis, ...]:
        """Return the patterns that unseen days tell where nothing else is told, one of each kind."""
        if not self.by_days or self.is_unlike:
            return ()
        return unexplained.find(self.resolved(), self.site.longitude, self.knowledge.by_physics(self.rules), rng)

    def _expected(self, laid_out: Design) -> Design:
        null_gains = self.null_gains.times(self.rules.far_over_null if self.is_unlike else 1.0)
        unnamed = {one.key for one in self.unnamed}
        return history.expected(self.history, laid_out, self.misfit, self.without, null_gains, unnamed)

    def _laid_out(self, terms: list[ActiveTerm]) -> Design:
        if not terms:
            return self.plain
        if not self._latest or self._latest[0][0] != terms:
            self._latest[:] = [(terms, history.laid_out(self.days, self.site, self.history, terms, self.rules))]
        return self._latest[0][1]

    def resolved(self) -> Design:
        """Return the first design: by the steps that the history was learned from."""
        return self.design(self.knowledge.terms, self.days.record.step)


def search_of(
    days: LogDays,
    site: Site,
    knowledge: Knowledge,
    without: frozenset[str],
    rules: DecisionRules,
    nuisance: NuisanceSubspace | None,
    null_gains: NullGains | None,
    *,
    is_later: bool = False,
    by_days: bool = True,
) -> Search:
    """Return the search that fits what is known: of changes where the greenhouse's history applies to the log.

    What a change must gain was learned from the weeks next to a calibration. In later ones a season makes more of what
    a calibration misses, so that only what gains far more is told (`is_later`), and nothing that unseen days alone tell
    (`by_days`).
    """
    common = (days, site, knowledge, without, rules, nuisance or read_nuisance())
    known = knowledge.history
    if known is None:
        return Search(*common)
    plain = history.laid_out(days, site, known, (), rules)
    if not history.applies(known, plain):
        return Search(*common)
    misfit = history.expected_misfit(known, plain)
    return Change(*common, known, plain, misfit, null_gains or read_null_gains(), is_later, by_days)


def _explained(found: Sequence[Estimated]) -> float:
    return sum(one.gain for one in found)


def _is_inside(one: Estimated, design: Design) -> bool:
    """Tell whether a cause lies inside its bounds."""
    low, high = design.amplitude_bounds(one.effect, one.hypothesis.term.onset)
    amplitude = one.term.amplitude
    return amplitude < high and (low == 0.0 or amplitude > low)
