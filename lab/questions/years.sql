-- The same chainage over the years: verdict and largest hole of each section, dive by dive, including sections without a verdict
-- picture: strips x=chainage_m to=end_m row=dived colour=verdict
SELECT
    coalesce(d.plant || ' ', '') || coalesce(CAST(d.day AS VARCHAR), d.log) AS dived,
    s.chainage_m, s.end_m, s.verdict, s.cannot_say, s.cause, s.d_m, s.d_sd_m
FROM sections s JOIN dives d ON s.dive = d.dive
ORDER BY d.plant, d.day, d.log, s.chainage_m
