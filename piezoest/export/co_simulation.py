"""A co-simulation unit (FMI 2.0) from the generated C code."""

import platform
import sys
import tempfile
import uuid
import zipfile
from pathlib import Path
from typing import Any

from piezoest._checks import positive
from piezoest._files import replacing
from piezoest._version import __version__
from piezoest.compensators import Compensator
from piezoest.export.c_code import c
from piezoest.export.compiled import build_shared
from piezoest.export.generated import CCode, Precision, filled
from piezoest.models import LinearGain

# A file's date would make two equal units differ.
_DATE = (1980, 1, 1, 0, 0, 0)
_NAMESPACE = uuid.UUID("3f1d6f0e-6a3b-5c39-9a55-6d1f6f5f2a10")


def fmu(
    estimator: Any,
    compensator: Compensator,
    path: str | Path,
    *,
    name: str = "piezoest_controller",
    precision: Precision = "double",
    update_interval: int = 50,
    sample_rate: float | None = None,
) -> Path:
    """Write a co-simulation unit (FMI 2.0) that does what `Controller` does.

    Inputs r and x [µm], output u [V]; the limits and `frozen` are tunable parameters, the model in
    use is an output. One communication step is one sample, or several with the inputs held. Inside
    are the sources, and the binary for this computer.

    Parameters
    ----------
    estimator : HysteresisRLS, HysteresisEKF or None
        In its present state; None for feed-forward with a fixed model.
    compensator : InverseCompensator or LinearCompensator
        In its present state, with its limits.
    path : str or Path
        File to write, ending in ``.fmu``.
    name : str
        Name of the unit.
    precision : {"double", "float"}
        Type of the numbers inside.
    update_interval : int
        Samples between two changes of the compensator's model.
    sample_rate : float, optional
        [Hz]; taken from the estimator, or else from the limits.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        If an argument is refused, as by `c`; if the name does not end in ``.fmu``, no sample rate is known
        or there is no C compiler.
    """
    path = Path(path)
    if path.suffix != ".fmu":
        raise ValueError(f"path must end in .fmu, got {path}")
    if not isinstance(compensator, Compensator):
        raise ValueError(f"compensator must be one, got {compensator!r}: c() exports an AdaptiveFeedforward")
    rate = _sample_rate(estimator, compensator, sample_rate)
    code = c(estimator, compensator, name=name, precision=precision, update_interval=update_interval)
    guid = str(uuid.uuid5(_NAMESPACE, f"{code.source}{code.header}{rate!r}"))
    wrapper = filled("fmi2.c", name=name, real=precision, guid=guid, sample_rate=repr(rate))
    files = {
        "modelDescription.xml": _description(code, guid, rate, compensator).encode(),
        f"sources/{name}.h": code.header.encode(),
        f"sources/{name}.c": code.source.encode(),
        "sources/fmi2.c": wrapper.encode(),
    }
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        code.write(folder)
        (folder / "fmi2.c").write_text(wrapper, encoding="utf-8")
        platform_folder, suffix = _platform()
        binary = folder / f"{name}{suffix}"
        build_shared(folder, [f"{name}.c", "fmi2.c"], binary, "-fvisibility=hidden")
        files[f"binaries/{platform_folder}/{name}{suffix}"] = binary.read_bytes()
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for inside, content in files.items():
            entry = zipfile.ZipInfo(inside, _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content)
    return path


def _sample_rate(estimator: Any, compensator: Compensator, given: float | None) -> float:
    known = getattr(estimator, "sample_rate", None) or compensator.sample_rate
    if given is None and known is None:
        raise ValueError("sample_rate is unknown: pass sample_rate=, or --sample-rate, in Hz")
    if given is not None and known is not None and given != known:
        raise ValueError(f"sample_rate is {given:g} Hz, but estimator or compensator say {known:g} Hz")
    return positive("sample_rate", known if given is None else given)


def _platform() -> tuple[str, str]:
    """Folder and suffix of this computer's binaries."""
    bits = "64" if sys.maxsize > 2**32 else "32"
    known = {"Windows": ("win", ".dll"), "Darwin": ("darwin", ".dylib")}
    system, suffix = known.get(platform.system(), ("linux", ".so"))
    return f"{system}{bits}", suffix


def _description(code: CCode, guid: str, rate: float, compensator: Compensator) -> str:
    """Text of modelDescription.xml."""
    limits, linear = compensator.limits, isinstance(compensator.model, LinearGain)
    names = ("gain", "unused_1", "unused_2", "offset") if linear else ("alpha", "beta", "gamma", "offset")
    units = ("um/V", "", "", "um") if linear else ("1/V", "um/V", "um/V2", "um")
    reals = [
        ("r", "input", "continuous", "Next sample of the reference", "um", "0"),
        ("x", "input", "continuous", "Displacement measured after the previous voltage", "um", "0"),
        ("u", "output", "continuous", "Voltage", "V", None),
        ("minimum", "parameter", "tunable", "Least voltage", "V", _bound(limits.minimum)),
        ("maximum", "parameter", "tunable", "Largest voltage", "V", _bound(limits.maximum)),
    ]
    for name, unit in zip(names, units, strict=True):
        reals.append((f"model_{name}", "output", "discrete", f"Model in use: {name}", unit, None))
    variables = ""
    for reference, (name, causality, variability, text, unit, start) in enumerate(reals):
        initial = ' initial="calculated"' if causality == "output" else ""
        started = "" if start is None else f' start="{start}"'
        of_unit = f' unit="{unit}"' if unit else ""
        variables += (
            f'    <ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
            f'variability="{variability}"{initial} description="{text}">'
            f"<Real{of_unit}{started}/></ScalarVariable>\n"
        )
    outputs = [i for i, row in enumerate(reals, 1) if row[1] == "output"]
    unknowns = "".join(f'\n      <Unknown index="{i}"/>' for i in outputs)
    unit_list = "".join(f'\n    <Unit name="{unit}"/>' for unit in sorted({*units, "um", "V"} - {""}))
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{code.name}" guid="{guid}"
    description="Learns the hysteresis of a piezo stage and cancels it"
    copyright="The piezoest developers" license="MIT" generationTool="piezoest {__version__}"
    variableNamingConvention="flat" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="{code.name}" canHandleVariableCommunicationStepSize="true"
      canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true">
    <SourceFiles>
      <File name="{code.name}.c"/>
      <File name="fmi2.c"/>
    </SourceFiles>
  </CoSimulation>
  <UnitDefinitions>{unit_list}
  </UnitDefinitions>
  <DefaultExperiment startTime="0.0" stepSize="{1.0 / rate!r}"/>
  <ModelVariables>
{variables}    <ScalarVariable name="frozen" valueReference="0" causality="parameter" variability="tunable" \
description="Hold the model"><Boolean start="false"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs>{unknowns}
    </Outputs>
    <InitialUnknowns>{unknowns}
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


def _bound(value: float) -> str:
    """A limit; XML has no infinity that every tool reads."""
    return repr(max(-1e30, min(1e30, value)))
