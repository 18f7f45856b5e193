// Decodes frames of the commander: a JSON header, then the ranges of all scans in cm.

import { beamAngle } from "./beams.js";

const text = new TextDecoder();
const NO_RETURN = 65535;

/**
 * Decode a frame. Each scan gets `ranges`, m, Infinity without return, and `points`: x
 * and y of its readings, m, map frame, NaN without return.
 *
 * Layout: the length of the header (u32, little-endian), the header, then the ranges (u16,
 * little-endian). The `offset` of a scan is the index of its first range.
 */
export function decodeFrame(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const frame = JSON.parse(text.decode(new Uint8Array(buffer, 4, length)));
  const tail = new DataView(buffer, 4 + length);
  for (const robot of frame.robots) {
    for (const scan of robot.scans) {
      scan.ranges = readRanges(tail, scan);
      scan.points = placeReadings(scan);
    }
  }
  return frame;
}

function placeReadings(scan) {
  const points = new Float32Array(2 * scan.count);
  for (let beam = 0; beam < scan.count; beam++) {
    const range = scan.ranges[beam];
    const angle = beamAngle(scan, beam);
    points[2 * beam] = range === Infinity ? NaN : scan.x + range * Math.cos(angle);
    points[2 * beam + 1] = scan.y + range * Math.sin(angle);
  }
  return points;
}

function readRanges(tail, scan) {
  const ranges = new Float32Array(scan.count);
  for (let i = 0; i < scan.count; i++) {
    const centimetres = tail.getUint16(2 * (scan.offset + i), true);
    ranges[i] = centimetres === NO_RETURN ? Infinity : centimetres / 100;
  }
  return ranges;
}
