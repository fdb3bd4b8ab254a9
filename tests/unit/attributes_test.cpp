// Attributes from the file to the store and to the picture; folders of tiles; corrupt chunks.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>

#include "engine/cpu/cpu_backend.h"
#include "engine/scene/camera.h"
#include "lod/builder/points/aggregate_values.h"
#include "lod/import/import.h"
#include "lod/import/las/header.h"
#include "lod/store/attributes.h"
#include "lod/store/colour.h"
#include "lod/store/nearest.h"
#include "tests/support/laz_encoder.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

void writeBytes(const std::string& path, const std::vector<uint8_t>& bytes) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

/// `count` points of a plane in format 7, on distinct places, with attributes that follow from the index.
std::vector<uint8_t> planeRecords(size_t count, int32_t firstX = 0) {
    test::LazSpec spec;
    spec.format = 7;
    const uint32_t bytes = test::lazRecordBytes(spec);
    std::vector<uint8_t> records(count * bytes);
    for (size_t i = 0; i < count; ++i) {
        uint8_t* p = records.data() + i * bytes;
        const std::array<int32_t, 3> xyz{firstX + static_cast<int32_t>(i % 100) * 10,
                                         static_cast<int32_t>(i / 100) * 10, 0};
        std::memcpy(p, xyz.data(), 12);
        const auto intensity = static_cast<uint16_t>(i);
        std::memcpy(p + 12, &intensity, 2);
        p[14] = 0x11;
        p[16] = static_cast<uint8_t>(i % 100 < 50 ? 2 : 6);
        const double time = 1e9 + static_cast<double>(i) / 3;
        std::memcpy(p + 22, &time, 8);
        const std::array<uint16_t, 3> rgb{0x1000, 0x2000, 0x3000};
        std::memcpy(p + 30, rgb.data(), 6);
    }
    return records;
}

test::LazSpec planeSpec() {
    test::LazSpec spec;
    spec.format = 7;
    spec.version = 3;
    spec.chunkPoints = 500;
    return spec;
}

TEST(Attributes, LeavesKeepEveryValueAndSayItToWhoAsks) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    Rng rng(1);
    writeBytes(folder / "a.laz", test::encodeLas(planeSpec(), planeRecords(5000), true, rng));
    BuildSettings settings;
    settings.leafRecords = 300;
    settings.allAttributes = true;
    const BuildReport report = test::build({folder / "a.laz"}, folder / "a.stipple", *executor, settings);
    EXPECT_EQ(report.pointsOut, 5000u);
    const auto store = openStore(folder / "a.stipple");
    ASSERT_TRUE(store);
    ASSERT_TRUE(verifyStore(*store, *executor));
    const auto& attributes = store->description.attributes;
    std::map<std::string, size_t> at;
    for (size_t k = 0; k < attributes.size(); ++k) at[attributes[k].name] = k;
    for (const char* name : {"intensity", "return_number", "number_of_returns", "classification", "scan_angle",
                             "user_data", "source_id", "gps_time", "scanner_channel"})
        ASSERT_TRUE(at.count(name)) << name;
    EXPECT_EQ(attributes[at["gps_time"]].aggregate, Aggregate::none);
    EXPECT_EQ(attributes[at["intensity"]].greatest, 4999);
    EXPECT_EQ(attributes[at["intensity"]].least, 0);
    EXPECT_NEAR(attributes[at["intensity"]].low, 100, 3);
    EXPECT_EQ(attributes[at["classification"]].counts,
              (std::vector<std::pair<double, uint64_t>>{{2, 2500}, {6, 2500}}));
    for (const size_t i : {size_t{0}, size_t{1234}, size_t{4999}}) {
        const auto p =
            findNearest(*store, {0.1 * static_cast<double>(i % 100) + 0.02, 0.1 * static_cast<double>(i / 100), 0});
        ASSERT_TRUE(p) << p.error().line();
        EXPECT_EQ(p->lattice, (std::array<uint64_t, 3>{i % 100 * 10, i / 100 * 10, 0}));
        EXPECT_EQ(p->attributes[at["intensity"]], static_cast<double>(i));
        EXPECT_EQ(p->attributes[at["classification"]], i % 100 < 50 ? 2 : 6);
        EXPECT_EQ(p->attributes[at["gps_time"]], 1e9 + static_cast<double>(i) / 3);
    }
    // Coarse levels: values of the plane's own range; classes only those that there are.
    for (uint32_t n = 0; n < store->hierarchy.nodes.size(); ++n) {
        const auto classes = readAttribute(*store, n, at["classification"]);
        ASSERT_TRUE(classes);
        ASSERT_EQ(classes->size(), store->hierarchy.ownRecordsOf(store->hierarchy.nodes[n]));
        for (const uint8_t c : *classes) ASSERT_TRUE(c == 2 || c == 6);
    }
}

TEST(Attributes, MeansAreOfWhatHasData) {
    AttributeInfo info;
    info.type = ScalarType::i16;
    info.noData = 0;
    const auto meanOf = [&](const std::vector<int16_t>& values) {
        std::vector<AggregateValue> leaves;
        for (const int16_t v : values) leaves.push_back(leafValue(info, reinterpret_cast<const uint8_t*>(&v)));
        int16_t stored = 0;
        storeValue(info, mergeValues(info, leaves), static_cast<uint32_t>(values.size()),
                   reinterpret_cast<uint8_t*>(&stored));
        return stored;
    };
    EXPECT_EQ(meanOf({0, 6, 0, 8}), 7);
    EXPECT_EQ(meanOf({6, 0, 0, 0}), 6);
    EXPECT_EQ(meanOf({0, 0}), 0) << "nothing was measured";
    EXPECT_EQ(meanOf({-5, 5}), 1) << "next to 0, which would say that nothing was measured";
    info.noData.reset();
    EXPECT_EQ(meanOf({0, 6, 0, 8}), 4) << "(3.5)";
}

TEST(Attributes, MeanModeAndNoneAreWhatTheySay) {
    AttributeInfo info;
    info.type = ScalarType::i16;
    info.scale = 0.006;
    const std::array<int16_t, 5> values{-30000, 5, 5, 30000, 7};
    // In one step, and in two: coarse records are made from finer ones.
    const auto of = [&](Aggregate how, size_t begin, size_t end, size_t split = 0) {
        info.aggregate = how;
        std::vector<AggregateValue> parts;
        const auto merged = [&](size_t from, size_t to) {
            std::vector<AggregateValue> leaves;
            for (size_t i = from; i < to; ++i)
                leaves.push_back(leafValue(info, reinterpret_cast<const uint8_t*>(&values.at(i))));
            return mergeValues(info, leaves);
        };
        for (const auto& [from, to] : {std::pair{begin, begin + split}, {begin + split, end}}) {
            if (from == to) continue;
            parts.push_back(merged(from, to));
        }
        int16_t v = 0;
        storeValue(info, mergeValues(info, parts), static_cast<uint32_t>(end - begin), reinterpret_cast<uint8_t*>(&v));
        return v;
    };
    EXPECT_EQ(of(Aggregate::mean, 0, 5, 2), 3);
    EXPECT_EQ(of(Aggregate::mode, 0, 5, 3), 5) << "two votes of {-30000, 5, 5} against one";
    EXPECT_EQ(of(Aggregate::mode, 2, 5, 1), 5) << "one vote each: the smallest as stored";
    EXPECT_EQ(of(Aggregate::mean, 0, 5), 3);  // -13 / 5 + ... = 17 / 5
    EXPECT_EQ(of(Aggregate::mean, 3, 4), 30000);
    EXPECT_EQ(of(Aggregate::mode, 0, 5), 5);
    EXPECT_EQ(of(Aggregate::mode, 3, 5), 7) << "of equals the smallest as stored";
    EXPECT_EQ(of(Aggregate::none, 0, 5), -30000);
}

TEST(Attributes, StoredFormsRoundToTheNearestAndStayInRange) {
    AttributeInfo info;
    for (const auto& [type, value, expected] :
         {std::tuple{ScalarType::u8, 300.0, 255.0}, std::tuple{ScalarType::u8, -3.0, 0.0},
          std::tuple{ScalarType::i8, -128.4, -128.0}, std::tuple{ScalarType::u16, 65535.4, 65535.0},
          std::tuple{ScalarType::i32, -2147483648.0, -2147483648.0},
          std::tuple{ScalarType::i64, 1e30, 9.223372036854775e18}, std::tuple{ScalarType::f64, 0.1, 0.1},
          std::tuple{ScalarType::f32, 0.5, 0.5}}) {
        info.type = type;
        std::array<uint8_t, 8> bytes{};
        storeAttribute(info, value, bytes.data());
        EXPECT_NEAR(attributeValue(info, bytes.data()), expected, std::abs(expected) * 1e-15) << value;
    }
}

TEST(Attributes, PicturesHaveTheColoursOfTheLegend) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    Rng rng(1);
    writeBytes(folder / "a.laz", test::encodeLas(planeSpec(), planeRecords(10000), true, rng));
    BuildSettings settings;
    settings.leafRecords = 300;
    settings.attributes = {"classification", "intensity"};
    test::build({folder / "a.laz"}, folder / "a.stipple", *executor, settings);
    const auto store = std::make_shared<const Store>(*openStore(folder / "a.stipple"));
    const auto colourAt = [&](const ColourBy& by, double fraction) {
        const auto backend = cpu::makeCpuBackend(*executor);
        auto state = render::makeFrameState({store}, *backend, *executor, {}, by);
        scene::Camera camera;
        camera.eye = {4.95, 4.95, 20};
        camera.target = {4.95, 4.95, 0};
        camera.up = {0, 1, 0};
        render::FrameSettings frame;
        frame.draw.lit = false;
        const lod::View view = scene::makeView(camera, 200, 200, 1e-3);
        EXPECT_TRUE(render::renderUntilComplete(*state, view, frame));
        return state->image.rgba[100 * 200 + static_cast<size_t>(50 + 100 * fraction)] & 0xffffffu;
    };
    const auto by = parseColourBy("class", "", "", store->description);
    ASSERT_TRUE(by) << by.error().line();
    EXPECT_TRUE(by->isCategorical);
    EXPECT_EQ(colourAt(*by, 0.2), colourOf(*by, 2));
    EXPECT_EQ(colourAt(*by, 0.8), colourOf(*by, 6));
    EXPECT_EQ(categoryName(*by, 6), "6 building");
    const auto flat = parseColourBy("height", "magma", "-1,0", store->description);
    ASSERT_TRUE(flat);
    EXPECT_EQ(colourAt(*flat, 0.5), colourOf(*flat, 0));
    EXPECT_EQ(colourOf(*flat, 0), 0xbffdfcu) << "magma ends in 0xfcfdbf";
    EXPECT_EQ(colourOf(*flat, 1e300), colourOf(*flat, 0));
    EXPECT_EQ(colourOf(*flat, std::nan("")), colourOf(*flat, -1));
    for (const auto& [what, map, range] : {std::tuple{"gps_time", "", ""}, std::tuple{"height", "rainbow", ""},
                                           std::tuple{"height", "", "3"}, std::tuple{"height", "", "3,3"}})
        EXPECT_FALSE(parseColourBy(what, map, range, store->description)) << what;
}

TEST(Tiles, FoldersPatternsAndOctreesAreOneScan) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    Rng rng(1);
    std::filesystem::create_directories(folder / "octree/ept-data");
    std::filesystem::create_directories(folder / "tiles/deep");
    writeBytes(folder / "octree/ept-data/0-0-0-0.laz", test::encodeLas(planeSpec(), planeRecords(1000), true, rng));
    writeBytes(folder / "octree/ept-data/1-0-0-0.laz",
               test::encodeLas(planeSpec(), planeRecords(700, 5000), true, rng));
    std::ofstream(folder / "octree/ept.json") << R"({"points": 1699})";
    writeBytes(folder / "tiles/a.laz", test::encodeLas(planeSpec(), planeRecords(300), true, rng));
    test::LazSpec fine = planeSpec();
    fine.scale = 0.001;
    fine.offset = 7.005;
    writeBytes(folder / "tiles/deep/b.LAS", test::encodeLas(fine, planeRecords(200), false, rng));
    for (const auto& [input, points] : {std::pair{"octree/ept.json", 1700u}, std::pair{"octree", 1700u},
                                        std::pair{"tiles", 500u}, std::pair{"tiles/*.laz", 300u}}) {
        const BuildReport r = test::build({folder / input}, folder / "o.stipple", *executor);
        EXPECT_EQ(r.pointsOut, points) << input;
        EXPECT_EQ(openStore(folder / "o.stipple")->description.roundingUnits, 0.0) << "0.01 and 0.001 share a lattice";
    }
    EXPECT_EQ(declaredByOctree(folder / "octree"), 1699u);
    EXPECT_FALSE(declaredByOctree(folder / "tiles"));
    EXPECT_FALSE(expandInputs({folder / "tiles/*.xyz"}));
    EXPECT_FALSE(
        expandInputs({folder / "octree/ept-data/../../tiles/none"}).value_or(std::vector<std::string>{}).empty());
}

TEST(Tiles, DifferentCoordinateSystemsAreRefusedByName) {
    const std::string utm =
        R"(PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]],UNIT["metre",1],AUTHORITY["EPSG","32632"]])";
    const std::string feet =
        R"(COMPD_CS["x",PROJCS["Oregon",GEOGCS["NAD83",UNIT["degree",0.0174]],UNIT["foot",0.3048]],VERT_CS["y",UNIT["metre",1]]])";
    const Crs a = las::crsOf(utm, {}, ""), b = las::crsOf(feet, {}, "");
    EXPECT_EQ(a.epsg, 32632);
    EXPECT_EQ(a.label(), "EPSG:32632 (WGS 84 / UTM zone 32N)");
    EXPECT_EQ(a.metresPerUnit, 1);
    EXPECT_EQ(b.name, "Oregon");
    EXPECT_EQ(b.metresPerUnit, 0.3048);
    EXPECT_FALSE(a.isDegrees);
    EXPECT_TRUE(las::crsOf(R"(GEOGCS["WGS 84",UNIT["degree",0.0174],AUTHORITY["EPSG","4326"]])", {}, "").isDegrees);
    const std::string wkt2 =
        R"(PROJCRS["U",CS[Cartesian,2],AXIS["e",east,LENGTHUNIT["US survey foot",0.304800609601219]],ID["EPSG",2269]])";
    EXPECT_NEAR(las::crsOf(wkt2, {}, "").metresPerUnit, 1200.0 / 3937, 1e-12);
    EXPECT_EQ(las::crsOf(wkt2, {}, "").epsg, 2269);
    EXPECT_FALSE(a.agreesWith(b));
    EXPECT_TRUE(a.agreesWith(Crs{}));
    // GeoTIFF: model projected, EPSG 26910, US survey feet.
    const std::array<uint16_t, 16> keys{1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 26910, 3076, 0, 1, 9003};
    std::vector<uint8_t> bytes(sizeof(keys));
    std::memcpy(bytes.data(), keys.data(), sizeof(keys));
    const Crs g = las::crsOf("", bytes, "");
    EXPECT_EQ(g.epsg, 26910);
    EXPECT_NEAR(g.metresPerUnit, 1200.0 / 3937, 1e-12);
}

/// A LAS file whose coordinate system is `wkt`.
std::vector<uint8_t> withWkt(std::vector<uint8_t> las, const std::string& wkt) {
    uint32_t dataOffset = 0, records = 0;
    std::memcpy(&dataOffset, las.data() + 96, 4);
    std::memcpy(&records, las.data() + 100, 4);
    std::string record(54, '\0');
    record.replace(2, 15, "LASF_Projection");
    const uint16_t id = 2112;
    std::memcpy(&record[18], &id, 2);
    const auto length = static_cast<uint16_t>(wkt.size());
    std::memcpy(&record[20], &length, 2);
    record += wkt;
    las.insert(las.begin() + dataOffset, record.begin(), record.end());
    dataOffset += static_cast<uint32_t>(record.size());
    ++records;
    std::memcpy(las.data() + 96, &dataOffset, 4);
    std::memcpy(las.data() + 100, &records, 4);
    return las;
}

TEST(Tiles, TheCoordinateSystemIsKeptAndAForeignTileNamed) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    Rng rng(1);
    const auto las = test::encodeLas(planeSpec(), planeRecords(300), false, rng);
    writeBytes(folder / "a.las", withWkt(las, R"(PROJCS["Here",UNIT["US survey foot",0.304800609601219]])"));
    writeBytes(folder / "b.las", withWkt(las, R"(PROJCS["There",UNIT["metre",1]])"));
    test::build({folder / "a.las"}, folder / "a.stipple", *executor);
    const auto store = openStore(folder / "a.stipple");
    ASSERT_TRUE(store);
    EXPECT_EQ(store->description.crs.name, "Here");
    EXPECT_NEAR(store->description.metresPerUnit, 0.3048006096, 1e-10);
    Progress silent(false);
    const auto mixed = buildStore({folder / "a.las", folder / "b.las"}, folder / "c.stipple", {}, *executor, silent);
    ASSERT_FALSE(mixed);
    for (const char* text : {"b.las", "There", "a.las", "Here"})
        EXPECT_NE(mixed.error().line().find(text), std::string::npos) << mixed.error().line();
}

TEST(Tiles, HeadersThatCannotBeAreRefusedWithTheirOffset) {
    const test::TempFolder folder;
    Rng rng(1);
    const auto las = test::encodeLas(planeSpec(), planeRecords(300), false, rng);
    const auto refusal = [&](size_t at, auto value) {
        auto changed = las;
        std::memcpy(changed.data() + at, &value, sizeof(value));
        writeBytes(folder / "a.las", changed);
        const auto source = openLas(folder / "a.las");
        return source ? std::string("none") : source.error().line();
    };
    for (const auto& [line, text] :
         {std::pair{refusal(131, 0.0), "scale 0"}, std::pair{refusal(139, -1.0), "scale -1"},
          std::pair{refusal(147, std::nan("")), "scale nan"}, std::pair{refusal(155, HUGE_VAL), "offset inf"},
          std::pair{refusal(105, uint16_t{35}), "needs 36"}, std::pair{refusal(104, uint8_t{11}), "point format 11"},
          std::pair{refusal(25, uint8_t{6}), "LAS 1.6"}, std::pair{refusal(94, uint16_t{200}), "offset 94"},
          std::pair{refusal(96, uint32_t{0x7fffffff}), "truncated"}, std::pair{refusal(104, uint8_t{0x87}), "laszip"},
          std::pair{refusal(247, uint64_t{1} << 62), "only 300 fit"}})
        EXPECT_NE(line.find(text), std::string::npos) << line;
}

TEST(Tiles, SkipBadLosesTheChunkAndCountsIt) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    Rng rng(1);
    auto bytes = test::encodeLas(planeSpec(), planeRecords(5000), true, rng);
    for (size_t i = bytes.size() / 2; i < bytes.size() / 2 + 40; ++i) bytes[i] = 0x5a;
    writeBytes(folder / "a.laz", bytes);
    writeBytes(folder / "b.laz", {'L', 'A', 'S', 'F', 0});
    Progress silent(false);
    BuildSettings settings;
    settings.allAttributes = true;  // layers that nobody wants are not read, and what is wrong in them is not seen
    const auto refused = buildStore({folder / "a.laz"}, folder / "o.stipple", settings, *executor, silent);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().line().find("chunk at offset"), std::string::npos) << refused.error().line();
    EXPECT_NE(refused.error().line().find("point format 7"), std::string::npos);
    EXPECT_NE(refused.error().line().find("--skip-bad"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(folder / "o.stipple"));
    settings.skipBad = true;
    const auto kept =
        buildStore({folder / "a.laz", folder / "b.laz"}, folder / "o.stipple", settings, *executor, silent);
    ASSERT_TRUE(kept) << kept.error().line();
    EXPECT_EQ(kept->pointsIn, 5000u);
    EXPECT_GE(kept->dropped.at("corrupt"), 500u);
    EXPECT_LE(kept->dropped.at("corrupt"), 1000u);
    EXPECT_EQ(kept->pointsOut + kept->dropped.at("corrupt"), 5000u);
    EXPECT_EQ(kept->skippedFiles, 1u);
    // Truncated LAS: what is there is read.
    auto las = test::encodeLas(planeSpec(), planeRecords(5000), false, rng);
    las.resize(las.size() / 2);
    writeBytes(folder / "c.las", las);
    EXPECT_FALSE(openLas(folder / "c.las"));
    const auto half = openLas(folder / "c.las", {{}, true});
    ASSERT_TRUE(half);
    EXPECT_EQ(*readPoints(*half), (las.size() - 375) / 36);
}

TEST(Tiles, FilesWithoutAChunkTableAreReadInOrder) {
    const test::TempFolder folder;
    Rng rng(1);
    for (const unsigned format : {1u, 7u}) {
        test::LazSpec spec = planeSpec();
        spec.format = format;
        spec.version = format > 5 ? 3 : 2;
        spec.hasTable = false;
        const auto records = test::makeRecords(spec, 3333, rng);
        writeBytes(folder / "a.laz", test::encodeLas(spec, records, true, rng));
        const auto source = openLas(folder / "a.laz");
        ASSERT_TRUE(source) << source.error().line();
        size_t at = 0;
        const auto read = readPoints(*source, [&](const PointBlock& block) -> Result<void> {
            for (const glm::ivec3& p : block.lattice)
                EXPECT_EQ(std::memcmp(&p, records.data() + at++ * test::lazRecordBytes(spec), 12), 0);
            return {};
        });
        ASSERT_TRUE(read) << read.error().line();
        EXPECT_EQ(*read, 3333u);
    }
}

}  // namespace
}  // namespace stipple::lod
