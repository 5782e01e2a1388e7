// node compare.mjs RUN OTHER LIMIT: mountings of two runs; fails where they differ by more than LIMIT sd of the first. 0: where
// a single bit differs.
import { readFileSync } from "node:fs";
import { expect } from "./common.mjs";

const [first, second, limit] = process.argv.slice(2);
const imus = (run) => JSON.parse(readFileSync(`${run}/calibration.json`)).imus;
const transposed = (a, b) => [0, 1, 2].map((i) => [0, 1, 2].map((j) => [0, 1, 2].reduce((s, k) => s + a[3 * k + i] * b[3 * k + j], 0)));
let worst = 0;
for (const imu of imus(first)) {
  const other = imus(second).find((each) => each.name === imu.name);
  expect(other !== undefined, `${second} has no ${imu.name}`);
  const R = transposed(imu.C_b_s, other.C_b_s);
  // Small angles: half of what is not symmetric.
  const turn = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]].map((x) => (x / 2) * (180 / Math.PI));
  const shares = [
    ...turn.map((x, i) => Math.abs(x) / imu.boresight_sd_deg[i]),
    ...imu.r_bs_b_m.map((x, i) => Math.abs(x - other.r_bs_b_m[i]) / imu.r_bs_b_sd_m[i]),
    Math.abs(imu.t_d_s - other.t_d_s) / imu.t_d_sd_s,
  ];
  worst = Math.max(worst, ...shares);
  if (Number(limit) > 0) continue;
  for (const key of ["C_b_s", "r_bs_b_m", "t_d_s", "gyro_bias_radps", "accel_bias_mps2", "boresight_sd_deg", "r_bs_b_sd_m", "status"])
    expect(JSON.stringify(imu[key]) === JSON.stringify(other[key]), `${imu.name}: ${key} differs between ${first} and ${second}`);
}
expect(worst <= Number(limit), `${second} differs from ${first} by ${worst.toFixed(4)} sd; ${limit} are allowed`);
console.log(`${second}: differs from ${first} by ${worst.toExponential(2)} sd at most (${limit} are allowed)`);
