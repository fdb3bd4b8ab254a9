// Filled ribbons of a block, placed side by side: leaves are many and a few pixels large. Included by curves.inl.

struct RibbonBatch {
    static constexpr uint32_t kMost = 32, kWords = sizeof(Ribbon) / sizeof(float);
    uint32_t count = 0;
    alignas(64) uint32_t segment[kMost];
    alignas(64) float ribbon[kWords][kMost], x[4][kMost], y[4][kMost];
    alignas(64) float line[kHullLines][6][kMost];  ///< HullLine
    alignas(64) int first[kMost], last[kMost];     ///< rows
    alignas(64) float isLarge[kMost];
    FilledRows rows[kMost];  ///< from `first` on
};

static_assert(RibbonBatch::kWords == 22, "as these two have them");
[[gnu::always_inline]] inline void setRibbon(RibbonBatch& to, size_t k, const Ribbon& r) {
    const auto set = [&](size_t word, const vec3& v) {
        to.ribbon[word][k] = v.x;
        to.ribbon[word + 1][k] = v.y;
        to.ribbon[word + 2][k] = v.z;
    };
    set(0, r.a);
    set(3, r.along);
    set(6, r.w);
    set(9, r.turn);
    set(12, r.n0);
    set(15, r.n1);
    set(18, r.n2);
    to.ribbon[21][k] = r.unit;
}
[[gnu::always_inline]] inline Ribbon ribbonAt(const RibbonBatch& of, size_t k) {
    const auto at = [&](size_t word) {
        return vec3(of.ribbon[word][k], of.ribbon[word + 1][k], of.ribbon[word + 2][k]);
    };
    return {at(0), at(3), at(6), at(9), at(12), at(15), at(18), of.ribbon[21][k]};
}
[[gnu::always_inline]] inline void setLine(RibbonBatch& to, size_t line, size_t k, const HullLine& h) {
    to.line[line][0][k] = h.top;
    to.line[line][1][k] = h.bottom;
    to.line[line][2][k] = h.x;
    to.line[line][3][k] = h.slope;
    to.line[line][4][k] = h.least;
    to.line[line][5][k] = h.most;
}
[[gnu::always_inline]] inline HullLine lineAt(const RibbonBatch& of, size_t line, size_t k) {
    return {of.line[line][0][k], of.line[line][1][k], of.line[line][2][k],
            of.line[line][3][k], of.line[line][4][k], of.line[line][5][k]};
}

/// Where they lie: corners, lines between them, rows (none of those beside the picture).
void placeRibbons(const FrameConstants& frame, const DrawNode& drawNode, const uint32_t* __restrict words,
                  RibbonBatch& __restrict batch) {
    const FrameConstants f = frame;
    const DrawNode node = drawNode;
    const float width = float(int(f.width)), height = float(int(f.height));
    const size_t count = batch.count;
#pragma GCC ivdep
    for (size_t k = 0; k < count; ++k) {
        const CameraSegment c = cameraSegment(node, segmentAt(words, batch.segment[k]));
        const PlacedRibbon p = placeRibbon(f, c);
        setRibbon(batch, k, p.ribbon);
        batch.x[0][k] = p.x[0];
        batch.x[1][k] = p.x[1];
        batch.x[2][k] = p.x[2];
        batch.x[3][k] = p.x[3];
        batch.y[0][k] = p.y[0];
        batch.y[1][k] = p.y[1];
        batch.y[2][k] = p.y[2];
        batch.y[3][k] = p.y[3];
        const auto line = [&](size_t l) __attribute__((always_inline)) {
            const size_t from = kHullFrom[l], to = kHullTo[l];
            setLine(batch, l, k, hullLine(p.x[from], p.y[from], p.x[to], p.y[to]));
        };
        static_assert(kHullLines == 6, "a loop over them would keep GCC from SIMD");
        line(0);
        line(1);
        line(2);
        line(3);
        line(4);
        line(5);
        const float left = leastOf(p.x), right = mostOf(p.x), top = leastOf(p.y), bottom = mostOf(p.y);
        const float isBeside = isBesidePicture(left, right, top, bottom, width, height);
        batch.isLarge[k] = isLargeBox(left, right, top, bottom, width, height) * (1.0f - isBeside);
        batch.first[k] = firstRowOf(p.y, 0.0f, height - 1.0f);
        const int last = lastRowOf(p.y, 0.0f, height - 1.0f);
        batch.last[k] = isBeside > 0.5f ? -1 : last;
    }
}

/// Fills those of a batch, or, of one that covers much of the image, leaves it to all threads. Of all of them where
/// rows begin is asked for before the pixels of the first are read.
void fillBatch(const FrameConstants& frame, const DrawNode& node, const uint32_t* words, uint64_t firstId,
               const WideSink& wide, const Visibility& visibility, RibbonBatch& batch) {
    const FrameConstants f = frame;
    const float width = float(int(f.width));
    placeRibbons(f, node, words, batch);
    const auto rowsFrom = [&](size_t k, int y, FilledRows& rows) __attribute__((always_inline)) {
        HullLine lines[kHullLines];
        for (size_t l = 0; l < kHullLines; ++l) lines[l] = lineAt(batch, l, k);
        hullRows(lines, width, y, rows);
    };
    for (size_t k = 0; k < batch.count; ++k) {
        if (batch.last[k] < batch.first[k] || batch.isLarge[k] > 0.5f) continue;
        const FilledRows& rows = batch.rows[k];
        rowsFrom(k, batch.first[k], batch.rows[k]);
        const int most = batch.first[k] + int(kRowGroup) - 1, last = batch.last[k] < most ? batch.last[k] : most;
        for (int y = batch.first[k]; y <= last; ++y)
            __builtin_prefetch(visibility.keys + size_t(y) * f.width + size_t(rows.left[y - batch.first[k]]), 1);
    }
    for (size_t k = 0; k < batch.count; ++k) {
        const uint64_t id = firstId + batch.segment[k];
        if (batch.isLarge[k] > 0.5f) {
            FilledCurve s{};
            s.id = id;
            s.ribbon = ribbonAt(batch, k);
            for (size_t i = 0; i < 4; ++i) {
                s.x[i] = batch.x[i][k];
                s.y[i] = batch.y[i][k];
            }
            wide.keep(wide.context, s);
        } else if (batch.first[k] <= batch.last[k]) {
            fillRibbonRows(f, ribbonAt(batch, k), id, batch.first[k], batch.last[k], visibility,
                           [&](int y, FilledRows& rows) {
                               if (y == batch.first[k])
                                   rows = batch.rows[k];
                               else
                                   rowsFrom(k, y, rows);
                           });
        }
    }
    batch.count = 0;
}
