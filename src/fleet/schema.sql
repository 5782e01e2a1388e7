-- The catalogue of a fleet. docs/fleet.md says what the columns mean. Results first; what was tried to get them stands in
-- tables of its own (attempts, other_results), as it differs between two campaigns of the same results.
CREATE TABLE versions (program TEXT PRIMARY KEY, studies INTEGER NOT NULL, is_this INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE vehicles (vehicle TEXT PRIMARY KEY) WITHOUT ROWID;
CREATE TABLE units (unit TEXT PRIMARY KEY, certificate TEXT) WITHOUT ROWID;
CREATE TABLE mountings (vehicle TEXT, mounting TEXT, device TEXT, unit TEXT NOT NULL REFERENCES units,
  PRIMARY KEY (vehicle, mounting, device)) WITHOUT ROWID;
CREATE TABLE captures (capture TEXT PRIMARY KEY, sha256 TEXT, bytes INTEGER, vehicle TEXT, mounting TEXT, key TEXT,
  state TEXT NOT NULL, reason TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE drives (capture TEXT PRIMARY KEY REFERENCES captures, begin_utc TEXT, days REAL, duration_s REAL, static_s REAL,
  dynamic_s REAL, gnss_used INTEGER, distance_m REAL, lat_deg REAL, lon_deg REAL, worst TEXT NOT NULL,
  findings INTEGER NOT NULL, warnings INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE tracks (capture TEXT REFERENCES drives, point INTEGER, lat_deg REAL NOT NULL, lon_deg REAL NOT NULL,
  PRIMARY KEY (capture, point)) WITHOUT ROWID;
CREATE TABLE findings (capture TEXT REFERENCES drives, number INTEGER, device TEXT, harm TEXT NOT NULL,
  check_name TEXT NOT NULL, text TEXT NOT NULL, PRIMARY KEY (capture, number)) WITHOUT ROWID;
CREATE TABLE health (capture TEXT REFERENCES drives, device TEXT, unit TEXT, role TEXT, protocol TEXT, samples INTEGER,
  samples_lost INTEGER, bad_frames INTEGER, late INTEGER, problem TEXT, PRIMARY KEY (capture, device)) WITHOUT ROWID;
CREATE TABLE calibrations (capture TEXT REFERENCES drives, device TEXT, unit TEXT REFERENCES units, status TEXT,
  usability TEXT, temperature_degC REAL, psi_sd_deg REAL, r_x_m REAL, r_y_m REAL, r_z_m REAL, r_sd_m REAL, t_d_s REAL,
  t_d_sd_s REAL, PRIMARY KEY (capture, device)) WITHOUT ROWID;
CREATE TABLE models (capture TEXT REFERENCES drives, device TEXT, regime TEXT, axis TEXT, unit TEXT REFERENCES units,
  model TEXT, p_value REAL, identifiable INTEGER, simpler_model TEXT, seconds REAL,
  PRIMARY KEY (capture, device, regime, axis)) WITHOUT ROWID;
CREATE TABLE parameters (capture TEXT, device TEXT, regime TEXT, axis TEXT, process TEXT, name TEXT, unit_of_value TEXT,
  value REAL, sd REAL, ci_low REAL, ci_high REAL, PRIMARY KEY (capture, device, regime, axis, process, name)) WITHOUT ROWID;
CREATE TABLE quantities (quantity_id INTEGER PRIMARY KEY, quantity TEXT NOT NULL, regime TEXT NOT NULL, axis TEXT NOT NULL,
  unit_of_value TEXT NOT NULL, is_log INTEGER NOT NULL, UNIQUE (quantity, regime, axis));
CREATE TABLE measurements (quantity_id INTEGER REFERENCES quantities, unit TEXT REFERENCES units, capture TEXT REFERENCES drives,
  device TEXT, value REAL NOT NULL, sd REAL NOT NULL, PRIMARY KEY (quantity_id, unit, capture, device)) WITHOUT ROWID;
CREATE TABLE unit_results (unit TEXT REFERENCES units, quantity_id INTEGER REFERENCES quantities, drives INTEGER, mean REAL,
  mean_low REAL, mean_high REAL, drive_sd REAL, drive_sd_low REAL, drive_sd_high REAL,
  PRIMARY KEY (unit, quantity_id)) WITHOUT ROWID;
CREATE TABLE unit_mountings (unit TEXT REFERENCES units, mounting TEXT, device TEXT, drives INTEGER, psi_sd_deg REAL, r_x_m REAL,
  r_y_m REAL, r_z_m REAL, r_sd_m REAL, p_one_mounting REAL, why_not TEXT, PRIMARY KEY (unit, mounting, device)) WITHOUT ROWID;
CREATE TABLE population (quantity_id INTEGER PRIMARY KEY REFERENCES quantities, units INTEGER, drives INTEGER, mean REAL,
  mean_low REAL, mean_high REAL, unit_sd REAL, unit_sd_low REAL, unit_sd_high REAL, drive_sd REAL, drive_sd_low REAL,
  drive_sd_high REAL, tolerance_low REAL, tolerance_high REAL, per_degC REAL, per_degC_sd REAL, per_year REAL, per_year_sd REAL,
  data_sheet REAL);
CREATE TABLE outliers (kind TEXT, unit TEXT, capture TEXT, device TEXT, quantity_id INTEGER REFERENCES quantities, deviation REAL,
  t REAL, dof REAL, p REAL, p_corrected REAL, PRIMARY KEY (kind, unit, capture, device, quantity_id)) WITHOUT ROWID;
CREATE TABLE drifts (unit TEXT REFERENCES units, quantity_id INTEGER REFERENCES quantities, per_year REAL, sd REAL, dof REAL,
  p REAL, p_corrected REAL, PRIMARY KEY (unit, quantity_id)) WITHOUT ROWID;
CREATE TABLE certificates (unit TEXT REFERENCES units, quantity_id INTEGER REFERENCES quantities, against TEXT, stated REAL,
  now_ratio REAL, ratio_low REAL, ratio_high REAL, holds TEXT, PRIMARY KEY (unit, quantity_id, against)) WITHOUT ROWID;
CREATE TABLE attempts (key TEXT, number INTEGER, task TEXT, program TEXT, host TEXT, began_utc TEXT, ended_utc TEXT, end TEXT,
  reason TEXT, wall_s REAL, cpu_s REAL, peak_mb REAL, counts INTEGER, PRIMARY KEY (key, number)) WITHOUT ROWID;
CREATE TABLE other_results (key TEXT PRIMARY KEY, program TEXT, state TEXT, reason TEXT) WITHOUT ROWID;

-- How many of how many.
CREATE VIEW progress AS SELECT state, count(*) AS captures FROM captures GROUP BY state;
-- What has no study, and why.
CREATE VIEW without_study AS SELECT capture, state, reason FROM captures WHERE state <> 'studied';
-- The noise and calibration of every unit in every drive, in its own unit instead of logarithms.
CREATE VIEW by_drive AS SELECT m.unit, m.capture, m.device, q.quantity, q.regime, q.axis,
  CASE q.is_log WHEN 1 THEN exp(m.value) ELSE m.value END AS value,
  CASE q.is_log WHEN 1 THEN exp(m.value) * m.sd ELSE m.sd END AS sd, q.unit_of_value
  FROM measurements m JOIN quantities q USING (quantity_id);
-- What the fleet is: sd of logarithms are shares (0.1: ten per cent).
CREATE VIEW fleet AS SELECT q.quantity, q.regime, q.axis, p.units, p.drives,
  CASE q.is_log WHEN 1 THEN exp(p.mean) ELSE p.mean END AS mean,
  CASE q.is_log WHEN 1 THEN exp(p.mean_low) ELSE p.mean_low END AS mean_low,
  CASE q.is_log WHEN 1 THEN exp(p.mean_high) ELSE p.mean_high END AS mean_high,
  CASE q.is_log WHEN 1 THEN exp(p.tolerance_low) ELSE p.tolerance_low END AS tolerance_low,
  CASE q.is_log WHEN 1 THEN exp(p.tolerance_high) ELSE p.tolerance_high END AS tolerance_high,
  p.unit_sd, p.drive_sd, CASE q.is_log WHEN 1 THEN 'share' ELSE q.unit_of_value END AS unit_of_sd, p.data_sheet, q.unit_of_value
  FROM population p JOIN quantities q USING (quantity_id);
-- Units and drives that stand out, the surest first.
CREATE VIEW standing_out AS SELECT o.kind, o.unit, o.capture, o.device, q.quantity, q.regime, q.axis, o.deviation, o.p_corrected
  FROM outliers o JOIN quantities q USING (quantity_id) ORDER BY o.p_corrected;
-- Units that do not hold what their certificate or data sheet says.
CREATE VIEW not_holding AS SELECT c.unit, q.quantity, q.regime, q.axis, c.against, c.stated, c.now_ratio, c.ratio_low, c.ratio_high
  FROM certificates c JOIN quantities q USING (quantity_id) WHERE c.holds = 'no' ORDER BY c.ratio_low DESC;
-- Units that drift.
CREATE VIEW drifting AS SELECT d.unit, q.quantity, q.regime, q.axis, d.per_year, d.sd, d.p_corrected
  FROM drifts d JOIN quantities q USING (quantity_id) WHERE d.p_corrected < 0.05 ORDER BY d.p_corrected;
-- Samples lost and frames damaged, by unit.
CREATE VIEW losses AS SELECT unit, count(*) AS drives, sum(samples) AS samples, sum(samples_lost) AS samples_lost,
  sum(bad_frames) AS bad_frames, sum(late) AS late FROM health WHERE unit IS NOT NULL GROUP BY unit;
-- What the tasks took.
CREATE VIEW cost AS SELECT task, count(*) AS attempts, sum(wall_s) AS wall_s, sum(cpu_s) AS cpu_s, max(peak_mb) AS peak_mb
  FROM attempts GROUP BY task;
