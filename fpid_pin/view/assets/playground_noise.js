"use strict";
// NumPy's default_rng(seed).standard_normal, number for number: PCG64 (XSL RR, 128 bits: O'Neill,
// HMC-CS-2014-0905) and a ziggurat of 256 layers (Marsaglia and Tsang, J. Stat. Softw. 5(8), 2000).
// Draws are kept: a slider that moves asks for the same ones again.
const normals = (() => {
  const MULTIPLIER = 0x2360ed051fc65da44385df649fccf645n, WORD = (1n << 64n) - 1n;
  const WHOLE = (1n << 128n) - 1n, R = 3.6541528853610088, TWO52 = 4503599627370496;
  // Layers of equal area under exp(-x^2/2): edges w, heights f, and where no test is needed, k.
  const f = (x) => Math.exp(-0.5 * x * x), edges = new Float64Array(256);
  const area = 0.004928673233974655 ;
  edges[255] = R;
  for (let i = 254; i >= 1; i--) {
    edges[i] = Math.sqrt(-2 * Math.log(area / edges[i + 1] + f(edges[i + 1])));
  }
  const wi = Float64Array.from(edges, (x) => x / TWO52), fi = Float64Array.from(edges, f);
  const ki = Float64Array.from(edges, (x, i) => (i > 1 ? (edges[i - 1] / x) * TWO52 : 0));
  const base = area / f(R);
  [wi[0], fi[0], ki[0], ki[1]] = [base / TWO52, 1, (R / base) * TWO52, 0];
  const kept = [];
  let state = null, step = null;
  const next = () => {
    state = (state * MULTIPLIER + step) & WHOLE;
    const mixed = (state >> 64n) ^ (state & WORD), turn = state >> 122n;
    return ((mixed >> turn) | (mixed << ((64n - turn) & 63n))) & WORD;
  };
  const uniform = () => Number(next() >> 11n) / 9007199254740992;
  const one = () => {
    for (;;) {
      const bits = next(), layer = Number(bits & 255n), rest = bits >> 9n;
      const size = Number(rest & 0xfffffffffffffn);
      const x = (bits >> 8n) & 1n ? -size * wi[layer] : size * wi[layer];
      if (size < ki[layer]) return x;
      if (layer === 0) {
        for (;;) {
          const far = -Math.log1p(-uniform()) / R, y = -Math.log1p(-uniform());
          if (y + y > far * far) return (rest >> 8n) & 1n ? -(R + far) : R + far;
        }
      } else if ((fi[layer - 1] - fi[layer]) * uniform() + fi[layer] < f(x)) return x;
    }
  };
  return (generator) => {
    if (state === null) [state, step] = [BigInt(generator.state), BigInt(generator.inc)];
    let at = 0;
    return () => {
      if (at === kept.length) kept.push(one());
      return kept[at++];
    };
  };
})();
