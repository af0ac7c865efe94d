"""The report of a diagnosis: one page that a grower understands first, then the engineer's tables and plots."""

from igrow.trainer.report.page import render_report, write_diagnosis

__all__ = ["render_report", "write_diagnosis"]
