"""What people call the quantities, balances and other names of the program; `N_` marks a text for translation."""

from __future__ import annotations

from collections.abc import Mapping


def N_(message: str) -> str:  # noqa: N802  (the usual mark of gettext)
    """Return a text as it is: it is translated where it is told."""
    return message


NAMES: Mapping[str, str] = {
    # weather
    "outdoor_temperature": N_("outdoor temperature"),
    "outdoor_humidity": N_("outdoor humidity"),
    "outdoor_co2": N_("outdoor CO2"),
    "global_radiation": N_("global radiation"),
    "wind_speed": N_("wind speed"),
    "sky_temperature": N_("sky temperature"),
    "wind_direction": N_("wind direction"),
    "rain": N_("rain"),
    # climate, crop
    "air_temperature": N_("air temperature"),
    "air_humidity": N_("air humidity"),
    "air_co2": N_("CO2"),
    "par": N_("photosynthetic light"),
    "leaf_area_index": N_("leaf area index"),
    "plant_load": N_("plant load"),
    "net_growth": N_("net growth"),
    "fruit_fresh_weight": N_("harvested fresh weight"),
    # setpoints
    "heating_setpoint": N_("heating setpoint"),
    "co2_setpoint": N_("CO2 setpoint"),
    "lamp_on": N_("lamp switch"),
    "irrigation_on": N_("irrigation switch"),
    "humidity_setpoint": N_("humidity setpoint"),
    "ventilation_setpoint": N_("ventilation setpoint"),
    "minimum_pipe_setpoint": N_("minimum pipe setpoint"),
    "energy_screen_setpoint": N_("energy screen setpoint"),
    # actuators
    "rail_pipe_temperature": N_("pipe rail temperature"),
    "grow_pipe_temperature": N_("grow pipe temperature"),
    "vent_lee": N_("lee vents"),
    "vent_wind": N_("windward vents"),
    "energy_screen": N_("energy screen"),
    "blackout_screen": N_("blackout screen"),
    "lamp_power": N_("lamp power"),
    "co2_dosing": N_("CO2 dosing"),
    "irrigation": N_("irrigation"),
    # written by the gateway
    "separating_test": N_("separating test"),
    # separating tests
    "vent_square_wave": N_("vents to and fro"),
    "vent_opening": N_("open vents"),
    "dosing_pause": N_("pause of the CO2 dosing"),
    # what the simulator derives
    "mean_height": N_("mean height"),
    "elapsed_days": N_("time since it began"),
    "hour": N_("hour of the day"),
    "weekday": N_("day of the week"),
    "time": N_("time"),
    "sun_elevation": N_("height of the sun"),
    "sun_azimuth": N_("direction of the sun"),
    "radiation_inside": N_("radiation inside"),
    "vapour_concentration": N_("water vapour in the air"),
    "outdoor_vapour_concentration": N_("water vapour outside"),
    "vapour_deficit": N_("vapour pressure deficit"),
    "ventilation": N_("ventilation"),
    "transpiration": N_("transpiration"),
    "rail_pipe_excess": N_("pipe rail above air"),
    "grow_pipe_excess": N_("grow pipe above air"),
    # balances and channels
    "heat": N_("heat"),
    "vapour": N_("water vapour"),
    "co2": N_("CO2"),
    "light": N_("light"),
    "growth": N_("growth"),
    "air_exchange": N_("air exchange"),
    "light_loss": N_("loss of light"),
    "evaporation": N_("evaporation"),
    "assimilation": N_("assimilation"),
    # why readings are set aside
    "out of range": N_("out of range"),
    "spike": N_("spike"),
    "stuck": N_("stuck"),
    "outage": N_("outage"),
    # the usual alarms of the climate
    "too_cold": N_("too cold"),
    "too_hot": N_("too hot"),
    "too_damp": N_("too damp"),
    # limits of the crop
    "day_temperature": N_("temperature by day"),
    "night_temperature": N_("temperature at night"),
    "mean_temperature": N_("mean temperature of a day"),
    "temperature_difference": N_("largest difference within a day"),
    "temperature_drift": N_("fastest change of the temperature"),
    "light_sum": N_("light of a day"),
    "light_sum_high": N_("light of a day"),
    "dark_hours": N_("dark hours"),
    "co2_with_people": N_("CO2 while people are inside"),
    "rest": N_("least times between switching"),
    "dead_zone": N_("vents above the heating setpoint"),
    # regimes
    "day": N_("day"),
    "night": N_("night"),
    "calm": N_("calm"),
    "windy": N_("windy"),
    "vents shut": N_("vents shut"),
    "vents open": N_("vents open"),
    "first half": N_("first half"),
    "second half": N_("second half"),
    # models
    "measured": N_("measured"),
    "deployed": N_("deployed"),
    "recalibrated": N_("recalibrated"),
    "corrected": N_("corrected"),
    # how far ahead
    "1_step": N_("1 step"),
    "24_h": N_("24 hours"),
    "7_d": N_("7 days"),
    "discrepancy": N_("something that the model does not know"),
}
"""Name in the program -> in English."""
