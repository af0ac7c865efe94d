"""Forecasts of a site with all that a log can tell beside the parameters; none of it is in a bundle yet."""
