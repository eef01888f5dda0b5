"""Plots with two logarithmic axes, as SVG."""
import html
import math

WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 680, 400, 62, 36, 30, 46
COLOURS = ("#b3452c", "#d8923b", "#7c6a9c", "#5a8f5a", "#8a8a8a", "#4c78a8", "#1b4f8f")


def decades(values):
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return low, max(high, low + 1)


def shown(power, times=1):
    if -3 <= power <= 4:
        return f"{times * 10.0**power:,g}"
    return (f"{times}\u00b7" if times > 1 else "") + f"10<tspan dy='-5' font-size='9'>{power}</tspan>"


def ticks(low, high, length, least):
    """Yields position, label and colour of the ticks: decades, and 2 and 5 times them, with labels when a decade
    has at least `least` points."""
    step = length / (high - low)
    for power in range(low, high + 1):
        yield (power - low) * step, shown(power), "#ccc"
        for times in (2, 5) if power < high else ():
            yield (power - low + math.log10(times)) * step, shown(power, times) if step >= least else "", "#eee"


def plot(path, title, x_title, y_title, lines):
    """Writes a picture of lines (name, points); returns its name and title."""
    lines = [(name, [(x, y) for x, y in points if x > 0 and y > 0]) for name, points in lines]
    x_low, x_high = decades([x for _, points in lines for x, _ in points])
    y_low, y_high = decades([y for _, points in lines for _, y in points])
    tall = HEIGHT + 17 * ((len(lines) + 1) // 2) + 6
    width, height = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

    def at(x, y):
        return (LEFT + width * (math.log10(x) - x_low) / (x_high - x_low),
                TOP + height * (y_high - math.log10(y)) / (y_high - y_low))
    out = [f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {tall}' font-family='sans-serif' "
           f"font-size='12'><rect width='{WIDTH}' height='{tall}' fill='white'/>"
           f"<text x='{LEFT}' y='20' font-size='14'>{html.escape(title)}</text>"]
    for along, label, colour in ticks(x_low, x_high, width, 130):
        x = LEFT + along
        out.append(f"<line x1='{x:.1f}' x2='{x:.1f}' y1='{TOP}' y2='{TOP + height}' stroke='{colour}'/>"
                   f"<text x='{x:.1f}' y='{TOP + height + 16}' text-anchor='middle'>{label}</text>")
    for along, label, colour in ticks(y_low, y_high, height, 60):
        y = TOP + height - along
        out.append(f"<line x1='{LEFT}' x2='{LEFT + width}' y1='{y:.1f}' y2='{y:.1f}' stroke='{colour}'/>"
                   f"<text x='{LEFT - 6}' y='{y + 4:.1f}' text-anchor='end'>{label}</text>")
    out.append(f"<text x='{LEFT + width / 2}' y='{HEIGHT - 10}' text-anchor='middle'>{x_title}</text>"
               f"<text transform='translate(14 {TOP + height / 2}) rotate(-90)' text-anchor='middle'>{y_title}</text>")
    for i, (name, points) in enumerate(lines):
        colour = COLOURS[-1] if i == len(lines) - 1 else COLOURS[i % (len(COLOURS) - 1)]
        spots = [at(*p) for p in points]
        out.append(f"<polyline fill='none' stroke='{colour}' stroke-width='2' points='"
                   + " ".join(f"{x:.1f},{y:.1f}" for x, y in spots) + "'/>")
        out += [f"<circle cx='{x:.1f}' cy='{y:.1f}' r='3.5' fill='{colour}'/>" for x, y in spots]
        x, y = LEFT + 310 * (i % 2), HEIGHT + 8 + 17 * (i // 2)
        out.append(f"<circle cx='{x}' cy='{y - 4}' r='4' fill='{colour}'/>"
                   f"<text x='{x + 10}' y='{y}'>{html.escape(name)}</text>")
    path.write_text("\n".join(out) + "</svg>\n")
    return path.name, title
