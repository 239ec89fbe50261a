// Who can help whom, and with whom, wherever robots are: see innerattn.policies.exported.roles. Amounts need
// not be whole, so sums are rounded to 32 bits as numpy rounds them.

const NOT_NEEDED = 5; // what is to spare of nothing

const single = Math.fround;
const sumOf = (values) => values.reduce((sum, one) => single(sum + one), 0);
const sharesOne = (one, other) => one.some((value, at) => value > 0 && other[at] > 0);

/** What a victim needs, a number of each ability, means to robots with such abilities. */
function rolesAt(needs, abilities) {
  const sorts = needs.flatMap((need, sort) => (need > 0 ? [sort] : [])), needed = sumOf(needs);
  const fills = abilities.map((able) => able.map((one, sort) => (needs[sort] > 0 ? one : 0)));
  const useful = fills.map((row) => row.some((one) => one > 0));
  const sets = Array.from({ length: 2 ** sorts.length }, (_, chosen) => {
    const within = sorts.filter((_, bit) => (chosen >> bit) & 1), units = sumOf(within.map((sort) => needs[sort]));
    const helps = fills.map((row) => Number(within.some((sort) => row[sort] > 0)));
    const spare = units > 0 ? single(sumOf(helps) - units) : NOT_NEEDED;
    return { helps, spare, elsewhere: single(needed - units) };
  });
  const filled = fills.map((row) => row.map((one, sort) => single(one * needs[sort]))), mine = filled.map(sumOf);
  const either = (one, other) => (
    single(single(mine[one] + mine[other]) - sumOf(filled[one].map((value, sort) => single(value * fills[other][sort]))))
  );
  const ofPairs = (test) => fills.map((_, one) => fills.map((_, other) => one !== other && test(one, other)));
  return {
    needed, useful, sets,
    filledBy: fills.map(sumOf),
    spare: Math.min(...sets.map((set) => set.spare)),
    spareMine: fills.map((_, robot) => Math.min(...sets.map((set) => (set.helps[robot] ? set.spare : NOT_NEEDED)))),
    rivals: ofPairs((one, other) => sharesOne(fills[one], fills[other])),
    partners: ofPairs((one, other) => useful[one] && useful[other] && either(one, other) > 1),
  };
}
