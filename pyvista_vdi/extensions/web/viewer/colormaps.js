// Colour maps by the names that matplotlib and PyVista have for them, to within 2/255.

// Knots as base64, four bytes each: the place, and red, green and blue there.
const KNOTS = {
  gray: "AAAAAP////8",
  viridis: "AEQBVA5IFmgdSCl5LEQ7hDk+SolaLm2OgSCSjI8fn4iaI6mDqjW3ebxWxmfQhNRL7tLiG/bn5Bn//ecl",
  plasma: "AA0IhwsoBZIhTgKiNGwAqD99A6hHiAimWKAanG+7NIiG0U5yqu15U8r8ozji/cgn7PrYJPvy8if/8Pkh",
  turbo: "ADASOwY3JGYMPTWLEkFGrBhEVsceRmbdJEd27itGh/swQpT/Njqj/D0utPJFIMffSxrU0FAY3cJVGuS2WyXsp2I" +
    "49JFtYfxseIv/S4Ck/DyHt/c1kM3sNJzn1zmp+bw5t/6ZLMD7fiHI9GYX0uhLDNzYNwburxgB/3oEAw",
  coolwarm: "ADtMwBBOaNggYoLqMHea90CNsP5Qo8L+YLnQ+XDM2e2A3dzcj+vTxp/0xa2v97GUv/Sae9flcFjvyz4498Ao" +
    "L/+0BCY",
  bone: "AAAAAF1RUXG+psbG/////w",
  hot: "AAsAAF3/AAC+//4A/////w",
};

/** The names. */
export const COLORMAPS = Object.keys(KNOTS);

/** The colours of a map at 256 equidistant places, 0 to 1. */
export function colorsOf(name) {
  const bytes = Uint8Array.from(atob(KNOTS[name]), (c) => c.charCodeAt(0));
  let next = 4; // the knot that is not before the place
  return Array.from({ length: 256 }, (_, k) => {
    if (bytes[next] < k) next += 4;
    const share = (k - bytes[next - 4]) / (bytes[next] - bytes[next - 4]);
    return [1, 2, 3].map((c) => (bytes[next - 4 + c] + share * (bytes[next + c] - bytes[next - 4 + c])) / 255);
  });
}
