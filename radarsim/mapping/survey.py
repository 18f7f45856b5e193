"""Deprecated names of ``radarsim.exploration.exploration``."""

from radarsim.deprecation import deprecated_names

__getattr__ = deprecated_names(
    __name__,
    {
        "Survey": "radarsim.exploration.exploration.Exploration",
        "SurveyPlan": "radarsim.exploration.exploration.ExplorationPlan",
    },
)
