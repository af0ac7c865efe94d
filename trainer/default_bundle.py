"""The default bundle: the hybrid simulator of a greenhouse that nobody has measured yet.

Virtual seasons of the mechanistic greenhouse stand in for its log. The first of them is the greenhouse that the site
describes, under the grower's recipe: the physical parameters are fitted to it, as to the first log of a real one. The
others differ a little from it and are led by varied setpoints: from them the rules of the PLC, growth and yield are
learned, and the range that planning may use.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from igrow.core.bundle import BUILT_IN
from igrow.core.greenhouse import Season, generate_weather, simulate_many
from igrow.core.greenhouse.described import parameters_of
from igrow.core.greenhouse.recipe import recipe_course, varied_recipe
from igrow.core.quantities import USUAL_SETPOINTS
from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.site import Site
from igrow.trainer.calibration import calibrate
from igrow.trainer.data import prepare_log
from igrow.trainer.exporting.plan import RANGED
from igrow.trainer.fit.actuation import fit_actuation, setpoint_columns
from igrow.trainer.fit.model import FittedModel, training_envelope
from igrow.trainer.progress import Progress, silent
from igrow.trainer.training.crop import fit_net_growth, train_networks

START = np.datetime64("2020-01-20T00:00:00")
CREATED = datetime(2020, 6, 1, tzinfo=UTC)
"""Fixed, so that the same sources give the same bundle."""
GREENHOUSES, DAYS = 10, 56
SPREAD = 0.08
"""How far one greenhouse of this kind lies from the next, relative."""


def virtual_seasons(site: Site, count: int, days: int, seed: int) -> list[Season]:
    """Simulate greenhouses that differ, under weather that differs, with setpoints around the recipe.

    Args:
        site: describes their kind.
        count: of greenhouses.
        days: of each.
        seed: of everything.
    """
    random = np.random.default_rng(seed)
    end = START + np.timedelta64(days, "D")
    weathers = [generate_weather(START, end, seed=seed * 1000 + number) for number in range(count)]
    plain = parameters_of(site)
    plants = [plain, *(plain.varied(random, SPREAD / 2) for _ in range(count - 1))]
    return simulate_many(
        plants,
        weathers,
        [recipe_course(START, end), *(varied_recipe(START, end, random) for _ in range(count - 1))],
        START,
        end,
        count=count,
        seed=seed,
    )


def default_model(site: Site, *, seed: int = 0, progress: Progress = silent) -> FittedModel:
    """Build the simulator of an unmeasured site from virtual seasons.

    Args:
        site: describes the greenhouse.
        seed: of the virtual seasons and the training.
        progress: is told what is being done, in lines.
    """
    progress(f"simulating {GREENHOUSES} virtual greenhouses for {DAYS} days")
    seasons = virtual_seasons(site, GREENHOUSES, DAYS, seed)
    logs = [prepare_log(season.measured, site) for season in seasons]
    model = calibrate(logs[0], progress=progress)
    physical, alignment = model.posterior.values, model.alignment or 0.0
    parts = [(record := log.record(alignment), setpoint_columns(log.telemetry, record, site)[0], None) for log in logs]
    growth, harvest = train_networks([season.true for season in seasons], seed=seed, progress=progress)
    records = [site_record(season.true, site, 300.0) for season in seasons]
    conversion, maintenance = fit_net_growth(records, physical, [season.true for season in seasons])
    progress(
        f"growth: {conversion:.3f} kg of dry matter per kg of CO2, {24e3 * maintenance:.2f} g m-2 a day for maintenance"
    )
    columns = {name: np.concatenate([log.telemetry[name] for log in logs]) for name in (*RANGED, *USUAL_SETPOINTS)}
    return replace(
        model,
        # A virtual greenhouse, however well it was described: the real one is another, and so are its log and errors.
        calibrated_on=BUILT_IN,
        alignment=None,
        errors=(),
        actuation=fit_actuation(parts, physical),
        crop=CropStages(growth, harvest, conversion, maintenance),
        training_range=training_envelope(columns),
    )
