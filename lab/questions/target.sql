-- Effect of a target of 0.3 m: metres and flags of each dive at its own target and at 0.3 m
-- picture: bars label=log now=fail_m then=fail_at_03_m
SELECT
    d.log, d.plant, d.day, d.target_m,
    d.pass_m, d.fail_m, d.cannot_say_m, d.flags_raised,
    t.pass_m AS pass_at_03_m, t.fail_m AS fail_at_03_m, t.cannot_say_m AS cannot_say_at_03_m, t.flags_raised AS flags_at_03
FROM dives d JOIN replay('*', 'target_m=0.3', 'dives') t ON d.dive = t.dive
WHERE d.error IS NULL
ORDER BY d.plant, d.day, d.log
