"""The bands of radars for which materials have numbers."""

import math
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

BANDS_GHZ: Final = (24, 77, 94)


# Section from presets.settings.
# What makes a scanner the one that it is: its settings, and what fits together.

# The largest scene is 1 km wide; numbers far beyond it overflow somewhere.
Positive = Annotated[float, Field(ge=1e-3, le=1e5, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=1e5, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=1e-4, le=360, allow_inf_nan=False)]
Width = Annotated[float, Field(ge=0, le=90, allow_inf_nan=False)]
MOST_RAYS = 1_000_000  # of one scan
MOST_POWER = 1e12  # that is not unlimited
MOST_NODES = 100  # of a quadrature in a row; beyond it the outer weights are no numbers


def _step(value: float) -> float:
    """Take zero, or enough that ranges can be divided by it."""
    if 0 < value < 1e-6:
        raise ValueError("expected 0 or at least 1e-06")
    return value


class SensorSettings(BaseModel):
    """All numbers and choices of a scanner.

    Attributes:
        medium: Whether its beams are ``radar`` waves or ``laser`` light: which
            densities of the materials count.
        fov_deg: Angle between the first beam and the last.
        resolution_deg: Angle between neighbouring beams.
        max_range: m, inclusive.
        min_range: m; told to clients, and applied to nothing, as in USARSim.
        scan_rate_hz: Scans in a second on a robot, to whole hundredths of a second;
            None leaves it to the dialect.
        band_ghz: Of a radar: which column of the materials' dB counts.
        margin_db: How much weaker than where nothing is in between an echo may be, out
            and back; what makes the dB of materials penetration power.
        max_bounces: How often mirrors reflect a ray; after that they are surfaces.
        least_rcs_dbsm: The least radar cross section that shows 10 m away, in dB over
            a square metre; of rain, what is above it shows.
        echo_threshold: Share of a beam; what gives back less is neither its first nor
            its strongest echo.
        penetration_power: What a beam can lose to densities; infinite for one that
            nothing but an opaque surface stops.
        spent_reads: What a beam reads whose power runs out: the ``range`` of that
            point, ``zero``, as USARSim's Hokuyo in smoke, or ``nothing``.
        return_mode: Which of its echoes a beam keeps: the ``last``, at which its ray
            ended, the ``first``, the ``strongest``, or ``all``; its range is then
            that of the last.
        side_mode: Where the rays of a beam are: three of them, the outer two
            ``perpendicular`` to each beam, ``lateral`` on the sensor's left-right
            axis, or ``divergent`` from one point; or a ``cone`` of many.
        side_offset_uu: N, how far the side rays are beside their beam, in Unreal units
            of 4 mm; 0 for none.
        divergence_distance: m; how far away divergent rays are N units off.
        ray_weights: Chances of the right, centre and left ray to give the range, or
            their shares of the beam; in any unit.
        ray_choice: Whether one ray is ``drawn`` to answer for its beam, or all answer
            ``together``; None for drawn where the last echo is kept, and together
            where another one of the whole beam is.
        incidence_weights: Whether what a ray meets head-on counts more than what it
            grazes.
        beamwidth_az_deg: Of a cone, between its half-power points on one way, across.
        beamwidth_el_deg: The same, up and down.
        cone_rays: How many rays a cone has.
        cone_sampling: Whether these are the nodes of a ``quadrature``, or ``random``,
            drawn anew for each scan.
        range_noise: Standard deviation of ranges, m; 0 for none.
        range_noise_share: The same as a share of the range; the greater one counts.
        range_resolution: m; echoes of a beam that are nearer together merge; 0 for
            never.
        range_quantum: m; ranges are multiples of it; 0 for any number.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    medium: Literal["radar", "laser"]
    fov_deg: Angle
    resolution_deg: Angle
    max_range: Positive
    min_range: NotNegative = 0.0
    scan_rate_hz: Annotated[float, Field(ge=0.01, le=100)] | None = None
    band_ghz: Literal[24, 77, 94] = 94
    margin_db: Annotated[float, Field(ge=1, le=300)] = 50.0
    max_bounces: Annotated[int, Field(ge=0, le=16)] = 2
    least_rcs_dbsm: Annotated[float, Field(ge=-100, le=100)] = -22.0
    echo_threshold: Annotated[float, Field(ge=0, le=1)] = 0.001
    penetration_power: Annotated[float, Field(ge=0, allow_inf_nan=True)]
    spent_reads: Literal["range", "zero", "nothing"] = "range"
    return_mode: Literal["last", "first", "strongest", "all"] = "last"
    side_mode: Literal["perpendicular", "lateral", "divergent", "cone"] = (
        "perpendicular"
    )
    side_offset_uu: NotNegative = 0.0
    divergence_distance: Positive = 10.0
    ray_weights: tuple[NotNegative, NotNegative, NotNegative] = (1.0, 1.0, 1.0)
    ray_choice: Literal["drawn", "together"] | None = None
    incidence_weights: bool = False
    beamwidth_az_deg: Width = 0.0
    beamwidth_el_deg: Width = 0.0
    cone_rays: Annotated[int, Field(ge=1, le=10_000)] = 9
    cone_sampling: Literal["quadrature", "random"] = "quadrature"
    range_noise: NotNegative = 0.0
    range_noise_share: Annotated[float, Field(ge=0, le=1)] = 0.0
    range_resolution: NotNegative = 0.0
    range_quantum: Annotated[NotNegative, AfterValidator(_step)] = 0.0

    @property
    def beams(self) -> int:
        """How many beams a scan has."""
        return round(self.fov_deg / self.resolution_deg) + 1

    @property
    def power_per_db(self) -> float:
        """What a dB of a material, one way, is in penetration power.

        Of unlimited power it is no share; 1 then.
        """
        if math.isinf(self.penetration_power):
            return 1.0
        return self.penetration_power / (self.margin_db / 2)

    @property
    def has_side_rays(self) -> bool:
        """Whether its beams have more rays than one; lasers are ideal in that."""
        return self.medium == "radar"

    @property
    def combines_rays(self) -> bool:
        """Whether all rays of a beam answer for it."""
        if self.ray_choice is None:
            return self.return_mode != "last"
        return self.ray_choice == "together"

    @property
    def rays_per_beam(self) -> int:
        """How many rays a beam has, of which one may be drawn."""
        if not self.has_side_rays:
            return 1
        if self.side_mode == "cone":
            return self.cone_rays
        coincide = self.combines_rays and not self.side_offset_uu
        return 1 if coincide else 3

    @property
    def cone_grid(self) -> tuple[int, int]:
        """How many nodes a quadrature has across, and how many up and down."""
        if not self.beamwidth_el_deg:
            return self.cone_rays, 1
        if not self.beamwidth_az_deg:
            return 1, self.cone_rays
        rows = math.isqrt(self.cone_rays)
        while self.cone_rays % rows:
            rows -= 1
        return self.cone_rays // rows, rows

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        power = self.penetration_power
        if math.isnan(power) or MOST_POWER < power < math.inf:
            raise ValueError(
                f"penetration_power {power:g}, expected 0 to {MOST_POWER:g}, or .inf"
            )
        if sum(self.ray_weights) <= 0:
            raise ValueError(f"ray_weights {self.ray_weights}, expected one above 0")
        if self.resolution_deg > self.fov_deg:
            raise ValueError(
                f"resolution_deg {self.resolution_deg:g}, expected at most"
                f" fov_deg {self.fov_deg:g}"
            )
        self._check_number_of_rays()
        self._check_cone()
        return self

    def _check_number_of_rays(self) -> None:
        if self.beams > MOST_RAYS:
            raise ValueError(f"{self.beams} beams, expected at most {MOST_RAYS}")
        rays = self.beams * self.rays_per_beam
        if rays > MOST_RAYS and self.side_mode == "cone":
            raise ValueError(f"{rays} rays, expected at most {MOST_RAYS}")

    def _check_cone(self) -> None:
        """Refuse a cone without width, and a quadrature that is none."""
        widths = self.beamwidth_az_deg, self.beamwidth_el_deg
        if self.side_mode != "cone" or self.cone_rays == 1:
            return
        if not any(widths):
            raise ValueError(
                f"a cone of {self.cone_rays} rays, expected a beamwidth_az_deg or a"
                " beamwidth_el_deg above 0"
            )
        if self.cone_sampling == "random":
            return
        if max(self.cone_grid) > MOST_NODES:
            raise ValueError(
                f"cone_rays {self.cone_rays}, {max(self.cone_grid)} in a row, expected"
                f" at most {MOST_NODES}; random ones may be more"
            )
        if all(widths) and self.cone_grid[1] == 1:
            raise ValueError(
                f"cone_rays {self.cone_rays} over two widths, expected a product of"
                " two numbers above 1, such as 9 or 16"
            )
