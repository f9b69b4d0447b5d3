-- Effect of a new program version on all dives: sections by verdict before and now, and the change of D
-- picture: bars label=change metres=metres
SELECT
    b.verdict || ' -> ' || s.verdict AS change,
    count(*) AS sections,
    count(DISTINCT s.dive) AS dives,
    sum(s.end_m - s.chainage_m) AS metres,
    max(abs(s.d_m - b.d_m)) AS d_moved_most_m,
    avg(s.d_m - b.d_m) AS d_moved_mean_m
FROM sections s JOIN before_sections b ON s.dive = b.dive AND s.chainage_m = b.chainage_m
GROUP BY b.verdict, s.verdict
ORDER BY metres DESC, change
