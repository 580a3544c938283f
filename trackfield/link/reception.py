"""The share of frames that are received (packet reception ratio, PRR), from the signal-to-noise ratio.

Zuniga and Krishnamachari (2004): PRR = (1 - BER)^(8 f) for a frame of f bytes on the air, bit errors independent.
"""

from __future__ import annotations

from math import comb, exp


def power_ratio(db: float) -> float:
    """A ratio of powers given in dB."""
    return float(10 ** (db / 10))


def cc2420(snr_db: float, frame_bytes: int) -> float:
    """IEEE 802.15.4 at 2.4 GHz (O-QPSK, 16 sequences of 32 chips); standard 2006, annex E.4.1.8."""
    g = power_ratio(snr_db)
    ber = 8 / 15 / 16 * sum((-1) ** k * comb(16, k) * exp(20 * g * (1 / k - 1)) for k in range(2, 17))
    return float((1 - min(max(ber, 0.0), 0.5)) ** (8 * frame_bytes))


def mica2(snr_db: float, frame_bytes: int) -> float:
    """The CC1000 of a MICA2: non-coherent FSK, 19.2 kbit/s in 30 kHz of noise, hence g / (2 * 0.64)."""
    return float((1 - 0.5 * exp(-power_ratio(snr_db) / 1.28)) ** (8 * frame_bytes))


def dsss_dbpsk(snr_db: float, frame_bytes: int) -> float:
    """IEEE 802.11 DSSS at 1 Mbit/s: DBPSK, each bit spread over 22 MHz, so that Eb/N0 = 22 g."""
    return float((1 - 0.5 * exp(-22 * power_ratio(snr_db))) ** (8 * frame_bytes))
