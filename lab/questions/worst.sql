-- Worst sections of each plant: the ten largest holes of failed sections
-- picture: bars label=section d=d_m
SELECT * FROM (
    SELECT
        coalesce(d.plant || ' ', '') || CAST(round(s.chainage_m, 2) AS VARCHAR) || ' m' AS section,
        d.plant, d.log, d.day, s.chainage_m, s.d_m, s.d_sd_m, s.d_bounded, s.cause, s.samples,
        row_number() OVER (PARTITION BY d.plant ORDER BY s.d_m DESC, d.log, s.chainage_m) AS place
    FROM sections s JOIN dives d ON s.dive = d.dive
    WHERE s.verdict = 'fail'
)
WHERE place <= 10
ORDER BY plant, place
