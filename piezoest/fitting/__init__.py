"""A record to the model that misses it least: one fit for every kind."""

from piezoest.fitting.fitter import Fit, Fitter, Prediction, fit
from piezoest.fitting.forms import FORMS

__all__ = ["FORMS", "Fit", "Fitter", "Prediction", "fit"]
