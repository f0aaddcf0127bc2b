// color.js: the colour map: a curve in OKLCH (B. Ottosson, A perceptual color space for image processing, 2020) with
// linear lightness and evenly changing hue, so that equal steps of the value look equal.

function fromOklch(lightness, chroma, hue) {
  const a = chroma * Math.cos(hue), b = chroma * Math.sin(hue);
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s];
}

const encode = (x) => 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);

// sRGB in bytes for a value from 0 to 1, with as much chroma as sRGB can show, up to that of the map.
function colorOf(value) {
  const lightness = 0.29 + 0.64 * value, hue = (300 - 200 * value) * Math.PI / 180;
  for (let chroma = 0.15; ; chroma -= 0.005) {
    const color = fromOklch(lightness, Math.max(chroma, 0), hue);
    if (chroma <= 0 || color.every((x) => x >= 0 && x <= 1)) return color.map((x) => Math.round(encode(Math.min(Math.max(x, 0), 1))));
  }
}

function colorTable(count) {
  const bytes = new Uint8Array(4 * count);
  for (let i = 0; i < count; i++) bytes.set([...colorOf(i / (count - 1)), 255], 4 * i);
  return bytes;
}

function colorGradient() {
  const stops = [];
  for (let i = 0; i <= 16; i++) stops.push(`rgb(${colorOf(i / 16).join(' ')})`);
  return `linear-gradient(to right, ${stops.join(', ')})`;
}
