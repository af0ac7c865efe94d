"""igrow runs a greenhouse: `igrow.edge` on the gateway, `igrow.trainer` elsewhere, `igrow.core` what both share.

The three are links to the folders of the same names at the top of the repository (`igrow_core` for `igrow.core`), so
that an installation brings one package, `igrow`, and no module called `edge` or `trainer` into anyone's environment.
"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("igrow")
except PackageNotFoundError:  # a checkout that was not installed
    __version__ = "0+unknown"
