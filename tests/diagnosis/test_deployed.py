"""What a bundle says of a greenhouse depends on whether it was calibrated there."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.site import Greenhouse, Site
from igrow.trainer.cli import main
from igrow.trainer.diagnosis import from_manifest
from igrow.trainer.diagnosis.prior import ELSEWHERE
from igrow.trainer.export.bundle import read_hybrid_model, write_hybrid_bundle

HERE = Site(name="here", latitude=52.0, longitude=4.5)
LOW = replace(HERE, greenhouse=Greenhouse(mean_height=2.5))


def test_a_bundle_knows_the_greenhouse_it_was_calibrated_on() -> None:
    manifest = read_bundle(default_bundle_folder()).manifest
    own = from_manifest(manifest, replace(HERE, name=manifest.site))
    assert own.known_misfit
    assert own.standard_deviation["leakage_wind"] == manifest.parameters["leakage_wind"].standard_deviation


def test_of_another_greenhouse_it_says_less_and_follows_its_description() -> None:
    manifest = read_bundle(default_bundle_folder()).manifest
    same = from_manifest(manifest, HERE)
    assert not same.known_misfit
    for name, known in manifest.parameters.items():
        assert same.parameters[name] == pytest.approx(known.mean)
        assert same.standard_deviation[name] >= ELSEWHERE * known.mean
    low = from_manifest(manifest, LOW)
    assert low.parameters["leakage_wind"] == pytest.approx(2.0 * same.parameters["leakage_wind"], rel=0.01)


def test_an_exported_bundle_is_diagnosed_as_the_one_it_came_from(tmp_path: Path) -> None:
    built_in = read_bundle(default_bundle_folder())
    exported = write_hybrid_bundle(
        tmp_path / "low", read_hybrid_model(built_in, LOW), created=datetime(2020, 1, 1, tzinfo=UTC)
    )
    direct, through = from_manifest(built_in.manifest, LOW), from_manifest(exported.manifest, LOW)
    assert dict(through.parameters) == pytest.approx(dict(direct.parameters))
    assert dict(through.standard_deviation) == pytest.approx(dict(direct.standard_deviation), rel=0.01)


def test_a_bundle_exported_for_a_site_remembers_where_it_was_calibrated(tmp_path: Path) -> None:
    model = read_hybrid_model(read_bundle(default_bundle_folder()), HERE)
    bundle = write_hybrid_bundle(tmp_path / "exported", model, created=datetime(2020, 1, 1, tzinfo=UTC))
    assert not from_manifest(bundle.manifest, HERE).known_misfit
    calibrated = replace(model, calibrated_on=HERE.name)
    bundle = write_hybrid_bundle(tmp_path / "calibrated", calibrated, created=datetime(2020, 1, 1, tzinfo=UTC))
    assert from_manifest(bundle.manifest, HERE).known_misfit


def test_the_same_greenhouse_under_another_name_stays_calibrated(tmp_path: Path) -> None:
    site = tmp_path / "site.yaml"
    site.write_text("name: here\nlatitude: 52.0\nlongitude: 4.5\n")
    for folder, options in (("other", []), ("same", ["--same-greenhouse"])):
        assert main(["export", "--site", str(site), "--out", str(tmp_path / folder), *options]) == 0
        known = from_manifest(read_bundle(tmp_path / folder).manifest, HERE)
        assert bool(known.known_misfit) == bool(options)
