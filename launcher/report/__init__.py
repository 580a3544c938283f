"""The report of a finished run: figures as PNG files, and one page that holds them all and opens offline."""

from launcher.report.page import PAGE, write_report

__all__ = ["PAGE", "write_report"]
