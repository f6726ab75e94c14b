"""Schemas of earlier versions of the program, whose records still open, resume and report.

Only the rows of version 5 have a seal. The tables of version 3 have no rules either, so
`validation` checks every value by a query. A record keeps the schema with which it was created.
"""

from instrument.record.schema import tables_sql

_READING_3 = (
    "kind TEXT NOT NULL, surface TEXT NOT NULL, theta_i_deg REAL, dphi_deg REAL, theta_r_deg REAL, "
    "lamp_setting INTEGER NOT NULL, block INTEGER NOT NULL, signal_dn REAL, u_noise_dn REAL, "
    "u_quantisation_dn REAL, u_dark_dn REAL, u_placement_dn REAL, u_texture_dn REAL, "
    "exposure_s REAL, frames INTEGER NOT NULL, window_pixels REAL, "
    "saturated_pixels INTEGER NOT NULL, peak_dn REAL, time_s REAL, free_s REAL, "
    "time_utc TEXT NOT NULL, flags TEXT NOT NULL"
)
_SQL_3 = f"""
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE device (role TEXT PRIMARY KEY, identity TEXT NOT NULL);
CREATE TABLE setting (id INTEGER PRIMARY KEY, time_utc TEXT NOT NULL, role TEXT NOT NULL,
                      name TEXT NOT NULL, value TEXT NOT NULL);
CREATE TABLE event (id INTEGER PRIMARY KEY, time_utc TEXT NOT NULL, kind TEXT NOT NULL,
                    text TEXT NOT NULL);
CREATE TABLE dark (id INTEGER PRIMARY KEY, time_utc TEXT NOT NULL, exposure_s REAL NOT NULL,
                   frames INTEGER NOT NULL, mean_dn REAL NOT NULL, noise_dn REAL NOT NULL);
CREATE TABLE frame (step INTEGER NOT NULL, number INTEGER NOT NULL, exposure_s REAL NOT NULL,
                    time_s REAL NOT NULL, device_time_s REAL, file TEXT,
                    PRIMARY KEY (step, number));
CREATE TABLE preview (step INTEGER PRIMARY KEY, caption TEXT NOT NULL, png BLOB NOT NULL,
                      polygon TEXT NOT NULL);
CREATE TABLE reading (step INTEGER PRIMARY KEY, {_READING_3});
CREATE TABLE drift_at_resume (before_step INTEGER NOT NULL, expected REAL NOT NULL,
                              u_expected REAL NOT NULL, jumped INTEGER NOT NULL,
                              step INTEGER NOT NULL, {_READING_3});
"""

OLDER_SQL = {3: _SQL_3, **{version: tables_sql(version) for version in (4, 5, 6, 7)}}
"""The statements that make the tables, by schema version."""
