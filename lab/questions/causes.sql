-- Hours lost by cause, vehicle and pilot: the time to pass the open runs again
-- picture: bars label=who hours=hours
SELECT
    coalesce(d.vehicle, '-') || ', ' || coalesce(d.pilot, '-') || ', ' || r.cause AS who,
    d.vehicle, d.pilot, r.cause,
    count(*) AS runs,
    sum(r.failed_m) AS failed_m,
    coalesce(sum(r.takes_s), 0) / 3600 AS hours,
    -- Runs that no speed would have met: another mode or vehicle, and no hours to count.
    sum(CASE WHEN r.action IS NOT NULL AND r.takes_s IS NULL THEN 1 ELSE 0 END) AS runs_without_speed
FROM runs r JOIN dives d ON r.dive = d.dive
WHERE r.merged_into IS NULL
GROUP BY d.vehicle, d.pilot, r.cause
ORDER BY hours DESC, failed_m DESC, who
