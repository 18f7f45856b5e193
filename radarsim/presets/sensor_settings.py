"""The settings of scanners and cameras, with limits and allowed combinations.

Theory of operation
===================
The setting ``side_offset_uu``, N, is an offset in Unreal units, 250 per metre, not an
angle: the angle depends on the distance at which the offset holds. At D metres, rays N
units to either side are ``atan(N / (250 D))`` off the beam. So 50 units are 0.573
degrees at 20 m and 0.115 degrees at 100 m. Divergent rays keep this angle and have the
offset N only at D. Perpendicular and lateral rays keep the offset N, so their angle
decreases with distance.

An antenna is specified by its beamwidth: the angle between the two directions in which
it radiates half of its peak power. Side rays in these directions are half a beamwidth
from the centre. The pattern applies on transmission and on reception, so the effective
beam is narrower: a Gaussian with the standard deviation ``two_way_deviation``.

Sources: the noise model of a thesis on a radar for USARSim, section 4.3; USARSim's
scale of units.
"""

import math
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, BaseModel, Field, model_validator

BANDS_GHZ: Final = (24, 77, 94)  # radar bands for which materials have values

# The ray casting overflows for ranges far above 1 km, the largest width of a scene.
Positive = Annotated[float, Field(ge=1e-3, le=1e5, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=1e5, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=1e-4, le=360, allow_inf_nan=False)]
Width = Annotated[float, Field(ge=0, le=90, allow_inf_nan=False)]
FieldOfView = Annotated[float, Field(ge=1, le=170, allow_inf_nan=False)]
RightAngle = Annotated[float, Field(ge=1, le=90, allow_inf_nan=False)]
METRES_PER_UNIT: Final = 1 / 250  # USARSim's scale of Unreal units
MAX_RAYS = 1_000_000  # per scan; ``simulation.config`` has lower limits for clients
MAX_FINITE_POWER = 1e12
MAX_NODES = 100  # of a quadrature in a row; with more, the outer weights underflow


def _check_quantum(value: float) -> float:
    """Check the step to which ranges are rounded: 0, or at least 1e-6 m."""
    if 0 < value < 1e-6:
        raise ValueError("expected 0 or at least 1e-06")
    return value


class SensorSettings(BaseModel, extra="forbid", frozen=True):
    """All settings of a range scanner, radar or laser.

    Attributes:
        medium: Sensor type, ``radar`` or ``laser``; it selects which properties of the
            materials apply.
        fov_deg: Angle between the first and the last beam, degrees.
        resolution_deg: Angle between neighbouring beams, degrees.
        max_range: Maximum range, inclusive, m.
        min_range: Minimum range reported to clients, m; as in USARSim, shorter ranges
            are not suppressed.
        scan_rate_hz: Scans per second on a robot, to whole hundredths of a second;
            None for the rate of the dialect.
        band_ghz: Frequency band of a radar, GHz; it selects which dB values of the
            materials apply.
        margin_db: Largest two-way loss at which an echo is still detected, dB; it
            converts the dB of materials to penetration power.
        max_bounces: Maximum number of mirror reflections of a ray; the next mirror is
            treated like any other surface.
        glint_deg: Angle of incidence on a mirror, degrees, up to which the mirror
            returns an echo; 0 for no echoes. None means half the beamwidth for a cone,
            and 0 for other beams.
        least_rcs_dbsm: Smallest radar cross section that is detected at 10 m, dBsm;
            rain with a larger cross section is detected.
        echo_threshold: Strength above which an echo counts as the first or the
            strongest of its beam, 0 to 1; 1e-5 is -50 dB, the default margin.
        penetration_power: Power that a beam can lose to densities; infinite for a beam
            that ends only at opaque surfaces.
        detector: Method that finds ranges: the ``penetration`` model of rays, or for a
            sensor with an FMCW radar, a target detector for its spectrum: ``ca``,
            ``os`` or ``k``. With a target detector, noise, resolution, beamwidths and
            the number of rays are settings of the FMCW radar.
        detector_pfa: Probability of a false alarm per noise bin, for ``ca`` and ``os``.
        detector_count: Maximum number of bins that ``k`` selects at each azimuth.
        spent_reads: Reading of a beam whose power is depleted: the ``range`` of that
            point, ``zero``, as for USARSim's Hokuyo in smoke, or ``nothing``.
        return_mode: Which echoes of a beam are kept: the ``last``, at which its ray
            ended, the ``first``, read at its leading edge, the ``strongest``, read
            where half of its power has returned, or ``all``; with ``all``, the range is
            that of the last echo.
        side_mode: Arrangement of the rays of a beam: three rays, whose outer two are
            ``perpendicular`` to each beam, ``lateral`` on the sensor's left-right
            axis, or ``divergent`` from one point; or a ``cone`` of many rays.
        side_offset_uu: Offset N of the side rays from their beam, Unreal units of
            4 mm; 0 for none.
        divergence_distance: Distance at which divergent rays have the offset N, m.
        ray_weights: Relative weights of the right, centre and left ray: probabilities
            of being drawn, or shares of the beam's power.
        ray_choice: Whether one ray is ``drawn`` for each beam or all are evaluated
            ``together``; None means ``drawn`` if the last echo is kept, and
            ``together`` otherwise.
        incidence_weights: Whether surfaces hit at normal incidence have larger weights
            than surfaces hit at grazing angles.
        beamwidth_az_deg: Horizontal width of a cone between its one-way half-power
            points, degrees.
        beamwidth_el_deg: Vertical width of a cone between its one-way half-power
            points, degrees.
        cone_rays: Number of rays of a cone.
        cone_sampling: Directions of a cone's rays: the nodes of a ``quadrature``,
            ``even`` steps from edge to edge, or ``random``, drawn for each scan.
        range_noise: Standard deviation of ranges, m; 0 for none.
        range_noise_share: Standard deviation of ranges as a share of the range; the
            larger of the two standard deviations applies.
        range_resolution: Distance below which echoes of a beam are merged, m; 0 for no
            merging.
        range_quantum: Step to which ranges are rounded, m; 0 for no rounding.
    """

    medium: Literal["radar", "laser"]
    fov_deg: Angle
    resolution_deg: Angle
    max_range: Positive
    min_range: NotNegative = 0.0
    scan_rate_hz: Annotated[float, Field(ge=0.01, le=100)] | None = None
    band_ghz: Literal[24, 77, 94] = 94
    margin_db: Annotated[float, Field(ge=1, le=300)] = 50.0
    max_bounces: Annotated[int, Field(ge=0, le=16)] = 2
    glint_deg: Width | None = None
    least_rcs_dbsm: Annotated[float, Field(ge=-100, le=100)] = -22.0
    echo_threshold: Annotated[float, Field(ge=0, le=1)] = 1e-5
    penetration_power: Annotated[float, Field(ge=0, allow_inf_nan=True)]
    detector: Literal["penetration", "ca", "os", "k"] = "penetration"
    detector_pfa: Annotated[float, Field(ge=1e-12, le=0.1)] = 1e-6
    detector_count: Annotated[int, Field(ge=1, le=100)] = 12
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
    cone_sampling: Literal["quadrature", "even", "random"] = "quadrature"
    range_noise: NotNegative = 0.0
    range_noise_share: Annotated[float, Field(ge=0, le=1)] = 0.0
    range_resolution: NotNegative = 0.0
    range_quantum: Annotated[NotNegative, AfterValidator(_check_quantum)] = 0.0

    @property
    def beams(self) -> int:
        """The number of beams in a scan of the scanner."""
        return round(self.fov_deg / self.resolution_deg) + 1

    @property
    def has_detector(self) -> bool:
        """Whether the ranges are of targets that a detector finds in a spectrum."""
        return self.detector != "penetration"

    @property
    def power_per_db(self) -> float:
        """Penetration power lost per dB of one-way loss; 1 if power is unlimited."""
        if math.isinf(self.penetration_power):
            return 1.0
        return self.penetration_power / (self.margin_db / 2)

    @property
    def reads_first_returns(self) -> bool:
        """Whether the laser reads first returns, at random depths inside clouds."""
        return (
            self.medium == "laser"
            and 0 < self.penetration_power < math.inf
            and self.spent_reads == "nothing"
            and self.return_mode == "first"
        )

    @property
    def glint(self) -> float:
        """Largest angle of incidence, rad, at which a mirror returns an echo."""
        if self.glint_deg is not None:
            return math.radians(self.glint_deg)
        is_cone = self.has_side_rays and self.side_mode == "cone"
        width = max(self.beamwidth_az_deg, self.resolution_deg)
        return math.radians(width) / 2 if is_cone else 0.0

    @property
    def has_side_rays(self) -> bool:
        """Whether beams can have several rays; laser beams have one ray."""
        return self.medium == "radar"

    @property
    def combines_rays(self) -> bool:
        """Whether the range of a beam is found from the echoes of all its rays."""
        if self.ray_choice is None:
            return self.return_mode != "last"
        return self.ray_choice == "together"

    @property
    def rays_per_beam(self) -> int:
        """The number of rays that are cast for a beam, even if not all are used."""
        if not self.has_side_rays:
            return 1
        if self.side_mode == "cone":
            return self.cone_rays
        coincide = self.combines_rays and not self.side_offset_uu
        return 1 if coincide else 3

    @property
    def cone_grid(self) -> tuple[int, int]:
        """The number of rays of a beam's cone in azimuth, and in elevation."""
        if not self.beamwidth_el_deg:
            return self.cone_rays, 1
        if not self.beamwidth_az_deg:
            return 1, self.cone_rays
        rows = math.isqrt(self.cone_rays)
        while self.cone_rays % rows:
            rows -= 1
        return self.cone_rays // rows, rows

    @model_validator(mode="after")
    def _check_combinations(self) -> Self:
        power = self.penetration_power
        if math.isnan(power) or MAX_FINITE_POWER < power < math.inf:
            raise ValueError(
                f"penetration_power {power:g},"
                f" expected 0 to {MAX_FINITE_POWER:g}, or .inf"
            )
        if sum(self.ray_weights) <= 0:
            raise ValueError(f"ray_weights {self.ray_weights}, expected a sum above 0")
        if self.resolution_deg > self.fov_deg:
            raise ValueError(
                f"resolution_deg {self.resolution_deg:g}, expected at most"
                f" fov_deg {self.fov_deg:g}"
            )
        self._check_number_of_rays()
        self._check_cone()
        return self

    def _check_number_of_rays(self) -> None:
        if self.beams > MAX_RAYS:
            raise ValueError(f"{self.beams} beams, expected at most {MAX_RAYS}")
        rays = self.beams * self.rays_per_beam
        if rays > MAX_RAYS and self.side_mode == "cone":
            raise ValueError(f"{rays} rays, expected at most {MAX_RAYS}")

    def _check_cone(self) -> None:
        """Reject a cone of rays that has no width, or cannot be divided into rows."""
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
        if max(self.cone_grid) > MAX_NODES and self.cone_sampling == "quadrature":
            raise ValueError(
                f"cone_rays {self.cone_rays} have {max(self.cone_grid)} rays in a row,"
                f" expected at most {MAX_NODES} with cone_sampling 'quadrature'"
            )
        if all(widths) and self.cone_grid[1] == 1:
            raise ValueError(
                f"cone_rays {self.cone_rays} with two beamwidths, expected a product"
                " of two numbers above 1, such as 9 or 16"
            )


class CameraSettings(BaseModel, extra="forbid", frozen=True):
    """All settings of a camera of a robot.

    Attributes:
        fov_deg: Horizontal field of view, degrees.
        min_fov_deg: Smallest field of view to which clients can zoom, degrees.
        max_fov_deg: Largest field of view to which clients can zoom, degrees.
    """

    fov_deg: FieldOfView
    min_fov_deg: FieldOfView
    max_fov_deg: FieldOfView

    def limit(self, fov_deg: float) -> float:
        """Clip a field of view, degrees, to the zoom limits of the camera."""
        return max(self.min_fov_deg, min(self.max_fov_deg, fov_deg))


def offset_angle(side_offset_uu: float, distance: float) -> float:
    """Return the angle, rad, between a beam and its side ray with a given offset.

    Args:
        side_offset_uu: Offset N, Unreal units.
        distance: Distance D, m, above 0.

    >>> round(math.degrees(offset_angle(50, 20)), 3)
    0.573
    """
    return math.atan(side_offset_uu * METRES_PER_UNIT / distance)


def offset_units(angle: float, distance: float) -> float:
    """Return the offset N, Unreal units, of a side ray at an angle to its beam.

    Args:
        angle: Angle between the beam and a side ray, rad.
        distance: Distance D, m.

    >>> round(offset_units(math.radians(1.8) / 2, 100))
    393
    """
    return math.tan(angle) * distance / METRES_PER_UNIT


def two_way_deviation(beamwidth: float) -> float:
    """Return the standard deviation of a Gaussian beam's two-way antenna pattern.

    Args:
        beamwidth: Angle between the one-way half-power points; the result has the same
            unit.

    >>> round(two_way_deviation(1.0), 4)
    0.3003
    """
    return beamwidth / (4 * math.sqrt(math.log(2)))
