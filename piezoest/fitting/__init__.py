"""A record to the model that misses it least: one fit for every kind."""

from piezoest.fitting.fitter import Fitter, fit
from piezoest.fitting.forms import FORMS
from piezoest.fitting.result import Fit, Prediction

__all__ = ["FORMS", "Fit", "Fitter", "Prediction", "fit"]
