// voxel_clip.glsl: the first cell that stops a ray in what clip boxes leave of it; all of it where there are none.
//                  voxel_clip.cpp is its twin: the same spans, one after another.
// needs  voxel_walk.glsl
layout(std430, binding = 6) readonly buffer Boxes { double boxes[]; };  // least and greatest corner of each; the keeping ones first

struct Crossing {
    double from, to;
    int enters, leaves;  // faces of what lies behind, as the ray sees it
};

Crossing cross_box(int number, Ray ray) {
    Crossing crossing = Crossing(-infinity, infinity, inside, inside);
    for (int axis = 0; axis < 3; ++axis) {
        const double least = boxes[6 * number + axis], most = boxes[6 * number + 3 + axis];
        const double origin = at(ray.origin, axis), step = at(ray.direction, axis);
        if (step == 0.0lf) {
            if (origin < least || origin > most) return Crossing(infinity, -infinity, inside, inside);
            continue;
        }
        precise double in_t = ((step > 0.0lf ? least : most) - origin) / step, out_t = ((step > 0.0lf ? most : least) - origin) / step;
        const int face = 2 * axis + (step > 0.0lf ? 0 : 1);
        if (in_t > crossing.from) {
            crossing.from = in_t;
            crossing.enters = face;
        }
        if (out_t < crossing.to) {
            crossing.to = out_t;
            crossing.leaves = face;
        }
    }
    return crossing;
}

struct Span {
    double from, to;
    int face;
};

// The first part beyond `after` that is left. returns  false: there is none
bool next_span(Ray ray, double after, out Span span) {
    for (;;) {
        span = Span(after, view.keeping == 0 ? infinity : after, inside);
        bool found = view.keeping == 0;
        for (int i = 0; i < view.keeping; ++i) {
            const Crossing crossing = cross_box(i, ray);
            const double from = max(crossing.from, after);
            if (!(from < crossing.to) || (found && !(from < span.from))) continue;
            span = Span(from, crossing.to, crossing.from > after ? crossing.enters : inside);
            found = true;
        }
        if (!found) return false;
        for (bool grown = true; grown;) {
            grown = false;
            for (int i = 0; i < view.keeping; ++i) {
                const Crossing crossing = cross_box(i, ray);
                if (!(crossing.from <= span.to && crossing.to > span.to && crossing.from < crossing.to)) continue;
                span.to = crossing.to;
                grown = true;
            }
        }
        const double whole_to = span.to;
        for (bool moved = true; moved;) {
            moved = false;
            for (int i = view.keeping; i < view.keeping + view.removing; ++i) {
                const Crossing hole = cross_box(i, ray);
                if (!(hole.from <= span.from && span.from < hole.to)) continue;
                span.from = hole.to;
                span.face = hole.leaves;
                moved = true;
            }
        }
        if (span.from < whole_to) {
            for (int i = view.keeping; i < view.keeping + view.removing; ++i) {
                const Crossing hole = cross_box(i, ray);
                if (hole.from > span.from && hole.from < hole.to) span.to = min(span.to, hole.from);
            }
            return true;
        }
        if (!(whole_to < infinity)) return false;
        after = whole_to;
    }
}

Hit first_hit_left(Ray ray, double least_t, out int face) {
    Hit hit;
    hit.depth = 0;
    Span span;
    for (double after = least_t; next_span(ray, after, span); after = span.to) {
        double from = span.from, to = span.to;
        if (span.face != inside) from += 9.094947017729282e-13lf * abs(from);  // 2^-40
        if (to < infinity) to -= 9.094947017729282e-13lf * abs(to);
        hit = first_hit(ray, from, to);
        face = hit.face == inside ? span.face : hit.face;
        if (hit.depth != 0 || !(span.to < infinity)) return hit;
    }
    return hit;
}
