"""The bundle: what the trainer ships to a gateway, one folder that proves itself.

A bundle holds `simulator.onnx` (candidate strategies over a day), `optimizer.onnx` (one generation of the
genetic algorithm), where there is one `hindcast.onnx` (the climate given what the actuators did, for shadow
runs), further files that the manifest lists, `golden.npz` (inputs and the outputs they must give) and
`manifest.json`. The story of a bundle:

1. The trainer fills a `Manifest` and calls `write_bundle`: files are checksummed, written into a folder next
   to the target and renamed into place, so that nobody ever sees half a bundle.
2. A reader calls `read_bundle`: the manifest is read strictly, every checksum is compared, and what is wrong
   is said in one line.
3. `self_test` runs the golden inputs through onnxruntime on the machine that will use the bundle.
"""

from igrow.core.bundle.files import (
    BUILT_IN,
    GOLDEN_FILE,
    MANIFEST_FILE,
    REQUIRED_FILES,
    Bundle,
    Golden,
    default_bundle_folder,
    read_bundle,
    read_golden,
    write_bundle,
)
from igrow.core.bundle.manifest import (
    FORMAT_VERSION,
    BundleError,
    EffectRecord,
    Estimate,
    FittedParameter,
    GraphSignature,
    HeldOutError,
    Manifest,
    Onset,
    Span,
    Tensor,
)
from igrow.core.bundle.manifest_json import manifest_from_json, manifest_to_json
from igrow.core.bundle.self_test import Deviation, self_test
from igrow.core.bundle.session import new_session, open_session, run_graph

__all__ = [
    "BUILT_IN",
    "FORMAT_VERSION",
    "GOLDEN_FILE",
    "MANIFEST_FILE",
    "REQUIRED_FILES",
    "Bundle",
    "BundleError",
    "Deviation",
    "EffectRecord",
    "Estimate",
    "FittedParameter",
    "Golden",
    "GraphSignature",
    "HeldOutError",
    "Manifest",
    "Onset",
    "Span",
    "Tensor",
    "default_bundle_folder",
    "manifest_from_json",
    "manifest_to_json",
    "new_session",
    "open_session",
    "read_bundle",
    "read_golden",
    "run_graph",
    "self_test",
    "write_bundle",
]
