"""The settings of a rotating FMCW radar: sweep, antenna, receiver and digitisation."""

import math
from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, Field, model_validator

# Revision of the model of FMCW radars: a new revision computes other spectra.
RADAR_MODEL: Final = 3
SPEED_OF_LIGHT: Final = 299_792_458.0  # m/s
MAX_CELLS: Final = 4_000_000  # azimuths times bins
MAX_FAN_RAYS: Final = 500_000  # per revolution, before refinement

Decibels = Annotated[float, Field(ge=-300, le=300, allow_inf_nan=False)]


class FmcwSettings(BaseModel, extra="forbid", frozen=True):
    """All settings of a rotating FMCW radar.

    Attributes:
        carrier_ghz: Frequency in the middle of the sweep, GHz.
        bandwidth_mhz: Bandwidth of the sweep, MHz.
        azimuths: Number of evenly spaced azimuths per revolution.
        bins: Number of range bins at each azimuth.
        bin_size: Distance between bins, m; smaller than c/2B if the FFT is padded.
        rotation_hz: Revolutions per second. One sweep takes the time of one azimuth.
        window: Window function for the samples of a sweep.
        transmit_dbm: Transmitted power, dBm.
        noise_figure_db: Noise figure of the receiver, dB.
        noise_tilt_db: Decrease of the noise from the first bin to the last, dB.
        loss_db: Two-way losses in cables and radome, dB.
        beamwidth_az_deg: Horizontal width between the one-way half-power points,
            degrees.
        beamwidth_el_deg: Vertical width between the one-way half-power points, degrees.
        fan_deg: Angle below the horizon down to which the beam has a cosecant-squared
            pattern, degrees; 0 for a symmetric beam.
        fan_db: One-way level of this pattern relative to a squared cosecant that begins
            at the half-power point, dB.
        shoulder_db: Two-way level of the shoulders of the beam at one beamwidth from
            its middle in azimuth, dB.
        shoulder_slope_db: Decrease of the shoulders per further beamwidth, dB.
        sidelobe_db: Mean two-way level of the sidelobes in azimuth, dB.
        leakage_db: Leakage of the transmitter into the receiver, dB over the noise.
        leakage_range: Range up to which the leakage is constant, m; it ends at twice
            this range.
        phase_noise_db: Phase noise of the transmitter in each bin, dB relative to all
            power received at the same azimuth.
        full_scale_dbm: Power of a sine at the full scale of the ADC, dBm; stronger
            signals are clipped. The receiver has one channel, so harmonics beyond the
            last bin are aliased.
        clip_skew: Share of full scale by which the lower limit of the ADC is nearer to
            0 than the upper limit.
        clutter_shape: Shape of the gamma distribution of the local backscatter, which
            gives the power of rough surfaces and volumes a K distribution; 0 for
            constant backscatter over a surface.
        count_db: Decibels per count.
        floor_count: Count of the median of the noise.
        rays_across: Number of rays per azimuth step.
        rays_up: Number of rays between the lower and the upper edge of the beam.
    """

    carrier_ghz: Annotated[float, Field(ge=1, le=1000)]
    bandwidth_mhz: Annotated[float, Field(ge=1, le=100_000)]
    azimuths: Annotated[int, Field(ge=4, le=36_000)]
    bins: Annotated[int, Field(ge=16, le=65_536)]
    bin_size: Annotated[float, Field(ge=1e-3, le=100)]
    rotation_hz: Annotated[float, Field(ge=0.01, le=100)]
    window: Literal["rectangular", "hann", "hamming", "blackman"] = "blackman"
    transmit_dbm: Decibels = 10.0
    noise_figure_db: Decibels = 15.0
    noise_tilt_db: Annotated[float, Field(ge=0, le=60)] = 0.0
    loss_db: Decibels = 0.0
    beamwidth_az_deg: Annotated[float, Field(ge=0.05, le=45)]
    beamwidth_el_deg: Annotated[float, Field(ge=0.05, le=45)]
    fan_deg: Annotated[float, Field(ge=0, le=80)] = 0.0
    fan_db: Annotated[float, Field(ge=-60, le=0)] = 0.0
    shoulder_db: Annotated[float, Field(ge=-300, le=-10)] = -300.0
    shoulder_slope_db: Annotated[float, Field(ge=1, le=300)] = 16.5
    sidelobe_db: Annotated[float, Field(ge=-300, le=-10)] = -50.0
    leakage_db: Decibels = -300.0
    leakage_range: Annotated[float, Field(ge=0, le=100)] = 0.0
    phase_noise_db: Decibels = -300.0
    full_scale_dbm: Decibels = 100.0
    clip_skew: Annotated[float, Field(ge=0, le=1)] = 0.0
    clutter_shape: Annotated[float, Field(ge=0, le=1000)] = 0.0
    count_db: Annotated[float, Field(ge=0.01, le=10)] = 0.5
    floor_count: Annotated[float, Field(ge=0, le=255)] = 17.0
    rays_across: Annotated[int, Field(ge=1, le=64)] = 8
    rays_up: Annotated[int, Field(ge=1, le=64)] = 8

    @property
    def wavelength(self) -> float:
        """Wavelength of the radar's carrier, m."""
        return SPEED_OF_LIGHT / (self.carrier_ghz * 1e9)

    @property
    def resolution(self) -> float:
        """Range resolution of a frequency sweep with bandwidth B, c/2B, m."""
        return SPEED_OF_LIGHT / (2e6 * self.bandwidth_mhz)

    @property
    def padding(self) -> float:
        """Number of range bins in an interval of the range resolution."""
        return self.resolution / self.bin_size

    @property
    def sweep_time(self) -> float:
        """Duration of a frequency sweep, one per azimuth, s."""
        return 1.0 / (self.rotation_hz * self.azimuths)

    @property
    def max_range(self) -> float:
        """Maximum range of the radar: the end of its last range bin, m."""
        return self.bins * self.bin_size

    @property
    def step(self) -> float:
        """Angle between neighbouring azimuths of a revolution, rad."""
        return 2 * math.pi / self.azimuths

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        if self.azimuths * self.bins > MAX_CELLS:
            raise ValueError(
                f"{self.azimuths} azimuths of {self.bins} bins, expected at most"
                f" {MAX_CELLS} in all"
            )
        rays = self.azimuths * self.rays_across * self.rays_up
        if rays > MAX_FAN_RAYS:
            raise ValueError(f"{rays} rays in a scan, expected at most {MAX_FAN_RAYS}")
        if self.padding < 1:
            raise ValueError(
                f"bin_size {self.bin_size:g} m, expected at most c/2B,"
                f" {self.resolution:.4g} m with a sweep of {self.bandwidth_mhz:g} MHz"
            )
        return self
