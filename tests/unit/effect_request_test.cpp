// Which effects are asked for: lists, parameters, scene files, what the scene is made of; and what is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "engine/render/backdrop.h"
#include "engine/render/draw_list.h"
#include "engine/render/effects/request.h"
#include "engine/render/effects/table.h"
#include "engine/scene/scene.h"
#include "tests/support/support.h"

namespace stipple::render {
namespace {

SceneFacts unlitScan() {
    SceneFacts facts;
    facts.hasPoints = facts.hasUnlitPoints = true;
    return facts;
}
std::vector<std::string> namesIn(const DrawSettings& s) {
    std::vector<std::string> names;
    for (const EffectRequest& r : s.effects) names.push_back(r.name);
    return names;
}
using Names = std::vector<std::string>;

struct Asked {
    DrawSettings settings;
    Names notes;
};
Asked ask(const EffectWishes& wishes, const SceneFacts& facts, const SceneWishes& scene = {}, DrawSettings from = {}) {
    const auto notes = requestEffects(wishes, scene, facts, from);
    EXPECT_TRUE(notes) << notes.error().line();
    return {from, notes.value_or(Names{})};
}
void expectRefused(const EffectWishes& wishes, const Names& texts) {
    const auto checked = checkWishes(wishes);
    ASSERT_FALSE(checked) << wishes.list;
    EXPECT_EQ(checked.error().kind, ErrorKind::usage);
    for (const std::string& text : texts)
        EXPECT_NE(checked.error().line().find(text), std::string::npos) << checked.error().line();
}

TEST(EffectRequests, AutoCallsForWhatTheSceneNeeds) {
    EXPECT_TRUE(namesIn(ask({"auto", {}}, {}).settings).empty());
    const Asked unlit = ask({"auto", {}}, unlitScan());
    EXPECT_EQ(namesIn(unlit.settings), Names{"edl"});
    EXPECT_EQ(unlit.settings.effects.front().by, "points that keep their colours");
    SceneFacts bare;
    bare.hasPoints = bare.hasPointsWithoutNormals = true;
    EXPECT_EQ(namesIn(ask({"auto", {}}, bare).settings), Names{"edl"});
    SceneFacts smooth;
    smooth.hasMirrors = true;
    const Asked mirrors = ask({"auto", {}}, smooth);
    EXPECT_EQ(namesIn(mirrors.settings), Names{"reflection"});
    EXPECT_EQ(mirrors.settings.effects.front().by, "smooth materials");
    EXPECT_TRUE(namesIn(ask({"none", {}}, unlitScan()).settings).empty());
    EXPECT_TRUE(namesIn(ask({"auto,-edl", {}}, unlitScan()).settings).empty());
    EXPECT_EQ(namesIn(ask({"fog", {}}, unlitScan()).settings), Names{"fog"});
    EXPECT_EQ(namesIn(ask({"auto,fog", {}}, unlitScan()).settings), (Names{"fog", "edl"}));
}

TEST(EffectRequests, ShadowsComeWithASunAndUnderAutoWithLightsThatCast) {
    SceneFacts lamps;
    lamps.lightsThatCast = 1;
    EXPECT_EQ(namesIn(ask({"auto", {}}, lamps).settings), Names{"shadow"});
    EXPECT_TRUE(namesIn(ask({}, lamps).settings).empty()) << "lights of a file alone do not ask";
    EXPECT_EQ(namesIn(ask({"shadow", {}}, {}).settings), Names{"shadow"});
    DrawSettings sunny;
    sunny.lights.resize(1);
    sunny.lights[0].castsShadow = sunny.lights[0].isSun = true;
    for (const char* list : {"scene", "auto", "fog"}) {
        const Asked asked = ask({list, {}}, lamps, {}, sunny);
        ASSERT_TRUE(isRequested("shadow", asked.settings)) << list;
        EXPECT_FALSE(isRequested("edl", asked.settings)) << "the control";
        for (const EffectRequest& r : asked.settings.effects)
            if (r.name == "shadow") EXPECT_EQ(r.by, "--sun") << list;
    }
    for (const char* list : {"none", "auto,-shadow"}) {
        const Asked without = ask({list, {}}, lamps, {}, sunny);
        EXPECT_TRUE(namesIn(without.settings).empty()) << list;
        EXPECT_EQ(without.settings.lights.size(), 1u) << "it still shines";
        ASSERT_EQ(without.notes.size(), 1u);
        EXPECT_NE(without.notes.front().find("leaves shadow out, whatever --sun says"), std::string::npos);
    }
}

TEST(EffectRequests, WithoutAWordNothingIsCalledFor) {
    EXPECT_EQ(EffectWishes{}.list, "scene");
    EXPECT_TRUE(namesIn(ask({}, unlitScan()).settings).empty());
    const SceneWishes scene{{"fog"}, {"fog.density=0.5"}, "a.gltf"};
    EXPECT_EQ(namesIn(ask({}, unlitScan(), scene).settings), Names{"fog"});
    EXPECT_EQ(namesIn(ask({"scene,-fog", {}}, unlitScan(), scene).settings), Names{});
}

TEST(EffectRequests, NoneLeavesOutWhatOptionsAskForAndSaysSo) {
    DrawSettings windy;
    windy.wind.strength = 0.1;
    const Asked none = ask({"none", {}}, {}, {}, windy);
    EXPECT_EQ(none.settings.wind.strength, 0);
    ASSERT_EQ(none.notes.size(), 1u);
    EXPECT_NE(none.notes.front().find("leaves wind out, whatever --wind says"), std::string::npos) << none.notes[0];
    EXPECT_EQ(ask({"auto", {}}, {}, {}, windy).settings.wind.strength, 0.1);
    EXPECT_EQ(ask({"fog", {}}, {}, {}, windy).settings.wind.strength, 0.1) << "its own option asks for it";
    EXPECT_TRUE(ask({"none", {}}, {}).notes.empty()) << "nothing is left out";
}

TEST(EffectRequests, WhatIsTransparentIsLeftOutByNoneOrByName) {
    SceneFacts clear;
    clear.hasTransparent = true;
    for (const char* list : {"none", "-transparency", "auto,-transparency"}) {
        const Asked asked = ask({list, {}}, clear);
        EXPECT_FALSE(asked.settings.transparency) << list;
        EXPECT_EQ(asked.notes.size(), 1u) << list;
        EXPECT_TRUE(ask({list, {}}, {}).notes.empty()) << list << ": nothing is left out";
    }
    DrawSettings faint;
    faint.opacity = 0.5f;
    EXPECT_EQ(ask({"none", {}}, {}, {}, faint).settings.opacity, 1);
    for (const char* list : {"scene", "auto", "transparency"}) {
        EXPECT_TRUE(ask({list, {}}, clear).settings.transparency) << list;
        EXPECT_EQ(ask({list, {}}, {}, {}, faint).settings.opacity, 0.5f) << list;
    }
    DrawSettings opaque;
    const auto refused = requestEffects({"transparency", {}}, {}, {}, opaque);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().line().find("transparency needs --opacity"), std::string::npos) << refused.error().line();
}

TEST(EffectRequests, ParametersAskForTheirEffect) {
    const Asked fog = ask({"auto", {"fog.density=0.25", "fog.colour=10,20,30", "tone.curve=filmic"}}, {});
    EXPECT_EQ(namesIn(fog.settings), (Names{"fog", "tone"}));
    EXPECT_EQ(fog.settings.parameters.fog.density, 0.25);
    EXPECT_EQ(fog.settings.parameters.fog.colour, (std::array<double, 3>{10, 20, 30}));
    EXPECT_EQ(fog.settings.parameters.tone.curve, 1);
    // What a scene before has said is forgotten.
    EXPECT_EQ(ask({"auto", {}}, {}, {}, fog.settings).settings.parameters.fog.density, 0);
}

TEST(EffectRequests, SceneFilesAreHeardUnderSceneAndAuto) {
    const SceneWishes scene{{"fog", "nosuch"}, {"fog.density=0.5", "fog.density=nan"}, "a.gltf"};
    const Asked heard = ask({"auto", {}}, {}, scene);
    EXPECT_EQ(namesIn(heard.settings), Names{"fog"});
    EXPECT_EQ(heard.settings.effects.front().by, "the scene file");
    EXPECT_EQ(heard.settings.parameters.fog.density, 0.5);
    EXPECT_EQ(heard.notes.size(), 2u);
    for (const char* list : {"none", "edl"}) {
        const Asked other = ask({list, {}}, {}, scene);
        EXPECT_EQ(other.settings.parameters.fog.density, 0) << list;
    }
    // A person has the last word.
    EXPECT_EQ(ask({"auto", {"fog.density=2"}}, {}, scene).settings.parameters.fog.density, 2);
    EXPECT_TRUE(namesIn(ask({"auto,-fog", {}}, {}, scene).settings).empty());
}

TEST(EffectRequests, RefusesWhatIsUnknownContradictoryOrNoNumber) {
    expectRefused({"fgo", {}}, {"'fgo' is not an effect", "--effects", "fog", "edl", "tone"});
    expectRefused({"", {}}, {"'' is not an effect"});
    expectRefused({"none,fog", {}}, {"asks for none and for some"});
    expectRefused({"fog,-fog", {}}, {"asks for fog and leaves it out"});
    expectRefused({"light", {}}, {"'light' is asked for by --shade"});
    expectRefused({"none", {"fog.density=1"}}, {"fog is left out by --effects none"});
    expectRefused({"edl", {"fog.density=1"}}, {"fog is left out by --effects edl"});
    expectRefused({"auto", {"fog"}}, {"is not NAME.PARAMETER=VALUE"});
    expectRefused({"auto", {"fog.thickness=1"}}, {"has no parameter 'thickness'", "fog.density"});
    for (const char* bad : {"nan", "inf", "-inf", "-1", "", "1e400", "0x10", "1,2", "one"})
        expectRefused({"auto", {std::string("fog.density=") + bad}}, {"fog.density may be: 0 to 1e+09"});
    for (const char* bad : {"0", "nan", "inf", "9"})
        expectRefused({"auto", {std::string("edl.radius=") + bad}}, {"edl.radius may be: 1 to 8"});
    expectRefused({"auto", {"tone.curve=bright"}}, {"none, filmic"});
    expectRefused({"auto", {"fog.colour=1,2"}}, {"three numbers"});
    DrawSettings calm;
    const auto wind = requestEffects({"wind", {}}, {}, {}, calm);
    ASSERT_FALSE(wind);
    EXPECT_NE(wind.error().line().find("wind needs --wind"), std::string::npos) << wind.error().line();
}

/// Every parameter of the table: its ends are taken, what is beyond them is not.
TEST(EffectRequests, EveryParameterTakesWhatItSays) {
    for (const Effect* e : effects())
        for (const Parameter& p : e->parameters) {
            const std::string name = std::string(e->name) + "." + p.name + "=";
            const auto value = [&](const std::string& one) {
                std::string all = one;
                for (uint32_t i = 1; i < p.count; ++i) all += "," + one;
                return all;
            };
            for (const char* word : p.words) EXPECT_TRUE(checkWishes({"auto", {name + word}})) << name << word;
            if (p.words.empty())
                for (const double end : {p.least, p.most})
                    EXPECT_TRUE(checkWishes({"auto", {name + value(std::to_string(end))}})) << name << end;
            EXPECT_FALSE(checkWishes({"auto", {name + value("nan")}})) << name;
            if (p.words.empty())
                EXPECT_FALSE(checkWishes({"auto", {name + value(std::to_string(p.most + 1 + std::abs(p.most)))}}))
                    << name;
        }
}

TEST(SceneEffects, ComeBackFromTheirFile) {
    const test::TempFolder folder;
    scene::Scene scene;
    scene.nodes.emplace_back().name = "empty";
    scene.effects = {{"fog", "edl"}, {"fog.density=0.25", "fog.colour=1,2,3", "tone.curve=filmic"}};
    for (const char* name : {"a.gltf", "a.glb"}) {
        ASSERT_TRUE(scene::writeGltf(scene, folder / name));
        const auto back = scene::readGltf(folder / name);
        ASSERT_TRUE(back) << back.error().line();
        EXPECT_EQ(back->effects.names, scene.effects.names);
        std::vector<std::string> values = back->effects.values;
        std::sort(values.begin(), values.end());
        EXPECT_EQ(values, (Names{"fog.colour=1,2,3", "fog.density=0.25", "tone.curve=filmic"}));
    }
}

TEST(SceneEffects, OfAnotherShapeAreLeftOutWithANote) {
    const test::TempFolder folder;
    for (const char* extras :
         {R"({"stipple": 3})", R"({"stipple": {"effects": "fog"}})", R"({"stipple": {"effects": [1]}})",
          R"({"stipple": {"fog": 1}})", R"({"stipple": {"fog": {"density": {}}}})"}) {
        test::spit(folder / "b.gltf", std::string(R"({"asset": {"version": "2.0"}, "scene": 0, "nodes": [{}],
            "scenes": [{"nodes": [0], "extras": )") +
                                          extras + "}]}");
        const auto read = scene::readGltf(folder / "b.gltf");
        ASSERT_TRUE(read) << extras << ": " << read.error().line();
        EXPECT_TRUE(read->effects.names.empty() && read->effects.values.empty()) << extras;
        EXPECT_EQ(read->notes.size(), 1u) << extras;
    }
    test::spit(folder / "c.gltf", R"({"asset": {"version": "2.0"}, "scene": 0, "nodes": [{}],
        "scenes": [{"nodes": [0], "extras": "stipple"}]})");
    const auto read = scene::readGltf(folder / "c.gltf");
    ASSERT_TRUE(read);
    EXPECT_TRUE(read->notes.empty()) << "somebody else's";
}

/// Rows of README.md's table of effects: what is between their bars.
std::vector<std::vector<std::string>> rowsOfReadme() {
    std::istringstream readme(test::slurp(std::string(STIPPLE_SOURCE_DIR) + "/README.md"));
    std::vector<std::vector<std::string>> rows;
    bool isTable = false;
    for (std::string line; std::getline(readme, line);) {
        if (line.starts_with("| effect |")) isTable = true;
        if (!isTable || line.starts_with("|---") || line.starts_with("| effect |")) continue;
        if (!line.starts_with("|")) break;
        std::vector<std::string>& row = rows.emplace_back();
        std::istringstream cells(line.substr(1));
        for (std::string cell; std::getline(cells, cell, '|');) row.push_back(cell);
    }
    return rows;
}
/// What stands between backquotes.
std::vector<std::string> quotedIn(const std::string& text) {
    std::vector<std::string> out;
    for (size_t at = text.find('`'); at != std::string::npos;) {
        const size_t end = text.find('`', at + 1);
        if (end == std::string::npos) break;
        out.push_back(text.substr(at + 1, end - at - 1));
        at = text.find('`', end + 1);
    }
    return out;
}
/// All test programs' sources, one after another.
std::string testSources() {
    std::string all;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(std::string(STIPPLE_SOURCE_DIR) + "/tests"))
        if (entry.path().extension() == ".cpp") all += test::slurp(entry.path().string());
    return all;
}

TEST(EffectsOfTheReadme, AreAllOfTheTableWithWhoCallsForThemCostAndATestThatIsThere) {
    const auto rows = rowsOfReadme();
    const std::string sources = testSources();
    const auto isThere = [&](const std::string& test) {  // Suite.Name or Suite.*
        const std::string suite = test.substr(0, test.find('.')), name = test.substr(test.find('.') + 1);
        const std::string end = name == "*" ? "" : name + ")";
        return sources.find("TEST_F(" + suite + ", " + end) != std::string::npos ||
               sources.find("TEST(" + suite + ", " + end) != std::string::npos;
    };
    EXPECT_FALSE(isThere("ZeroCost.NoSuchTestIsThere")) << "the control";
    for (const Effect* e : effects())
        EXPECT_TRUE(std::any_of(rows.begin(), rows.end(), [&](const std::vector<std::string>& row) {
            return row.front().find(std::string("(`") + e->name + "`)") != std::string::npos;
        })) << e->name;
    EXPECT_GE(rows.size(), effects().size());
    for (const std::vector<std::string>& row : rows) {
        ASSERT_GE(row.size(), 4u) << row.front();
        EXPECT_GT(row[1].size(), 3u) << row.front() << ": who calls for it";
        EXPECT_GT(row[2].size(), 3u) << row.front() << ": what it costs";
        EXPECT_TRUE(row[3].starts_with(" 0: ")) << row.front();
        const std::vector<std::string> tests = quotedIn(row[3]);
        EXPECT_FALSE(tests.empty()) << row.front();
        for (const std::string& test : tests) EXPECT_TRUE(isThere(test)) << row.front() << test;
    }
}

TEST(EffectRequests, OptionsOfEffectsThatAreNotInTheProgramAreTakenBackWithANoteEach) {
    DrawSettings asked;
    asked.lights.resize(2);
    asked.lights[0].isSun = asked.lights[0].castsShadow = true;
    asked.lights[1].castsShadow = true;
    asked.wind.strength = 3;
    asked.backdrop = std::make_shared<const Backdrop>();
    DrawSettings settings = asked;
    Names notes;
    takeBack({}, settings, notes);  // as in tests' own builds
    EXPECT_TRUE(notes.empty());
    EXPECT_EQ(settings.wind.strength, 3.0f);
    EXPECT_TRUE(settings.lights[0].castsShadow);
    EXPECT_NE(settings.backdrop, nullptr);

    constexpr std::array<std::string_view, 4> kAll{"shadow", "wind", "background", "edl"};
    takeBack(kAll, settings, notes);
    ASSERT_EQ(notes.size(), 3u);
    const std::array kOptions{"--sun", "--wind", "--background environment"};
    for (size_t i = 0; i < kOptions.size(); ++i) {
        EXPECT_EQ(notes[i].find(kOptions.at(i)), 0u) << notes[i];
        EXPECT_NE(notes[i].find(kAll.at(i)), std::string::npos) << notes[i];
        EXPECT_NE(notes[i].find("not compiled into this program"), std::string::npos) << notes[i];
    }
    EXPECT_EQ(settings.wind.strength, 0.0f);
    EXPECT_EQ(settings.backdrop, nullptr);
    for (const WorldLight& light : settings.lights) EXPECT_FALSE(light.castsShadow);

    notes.clear();  // what was not asked for is no one's loss
    takeBack(kAll, settings, notes);
    EXPECT_TRUE(notes.empty());
    settings = asked;
    takeBack(std::span(kAll).subspan(1, 1), settings, notes);
    EXPECT_EQ(notes.size(), 1u);
    EXPECT_TRUE(settings.lights[0].castsShadow);
    EXPECT_NE(settings.backdrop, nullptr);
}

}  // namespace
}  // namespace stipple::render
