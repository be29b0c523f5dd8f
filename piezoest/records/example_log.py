"""A recording of a real stage that comes with the package."""

from importlib import resources
from pathlib import Path


def example_log() -> Path:
    """Path of a recorded log: 71 s of a piezo micromanipulator at 200 Hz, a sine of 1 Hz.

    Constant and growing amplitude with dwells; after the middle the voltage holds the authors' own
    compensation. Y. N. Aye and W. T. Ang, *A Discrete Backlash Operator for Identification and Compensation
    of Hysteresis and Non-linearity for Piezoelectric Micromanipulator*, ICSTSD, 2018; MIT licence, whose
    text and origin stand beside the file.

    Returns
    -------
    Path
        A CSV file with the columns time_s, voltage_V, displacement_um and reference_um, packed by gzip.

    Examples
    --------
    >>> import piezoest as pz
    >>> len(pz.read_record(pz.records.example_log()))
    14155
    """
    return Path(str(resources.files("piezoest.records") / "example" / "micromanipulator.csv.gz"))
