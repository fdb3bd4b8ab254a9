// The hands in the window: orbit, flying, what is orbited about afterwards, camera paths, and when a frame is drawn.
#include <gtest/gtest.h>

#include "apps/stipple/navigation.h"
#include "apps/stipple/view_pace.h"

namespace stipple::app {
namespace {

constexpr glm::dvec3 kUp{0, 0, 1};

scene::Camera lookingNorth() {
    scene::Camera camera;
    camera.eye = {0, -10, 0};
    camera.target = {0, 0, 0};
    camera.up = kUp;
    return camera;
}
Motion inWindow(uint32_t height) {
    Motion motion;
    motion.width = 2 * height;
    motion.height = height;
    motion.seconds = 0.05;
    return motion;
}
void expectNear(const glm::dvec3& a, const glm::dvec3& b, double tolerance) {
    EXPECT_LT(glm::length(a - b), tolerance)
        << a.x << ' ' << a.y << ' ' << a.z << " is not " << b.x << ' ' << b.y << ' ' << b.z;
}

TEST(Navigation, NothingMovesWithoutHands) {
    Navigation n(lookingNorth(), kUp, 20);
    n.move(inWindow(720));
    EXPECT_EQ(n.camera().eye, lookingNorth().eye);
    EXPECT_TRUE(inWindow(720).isIdle());
}

TEST(Navigation, OrbitKeepsDistanceAndTarget) {
    Navigation n(lookingNorth(), kUp, 20);
    Motion m = inWindow(720);
    m.turn = {300, -120};
    n.move(m);
    EXPECT_NEAR(glm::length(n.camera().eye - n.camera().target), 10, 1e-9);
    expectNear(n.camera().target, glm::dvec3(0), 1e-12);
    EXPECT_LT(n.camera().eye.z, 0) << "the picture follows the hand: upwards shows it from below";
}

TEST(Navigation, AWindowOfTwiceThePixelsTurnsAsFar) {
    Navigation small(lookingNorth(), kUp, 20), large(lookingNorth(), kUp, 20);
    Motion m = inWindow(720);
    m.turn = {100, 40};
    small.move(m);
    m = inWindow(1440);
    m.turn = {200, 80};
    large.move(m);
    expectNear(small.camera().eye, large.camera().eye, 1e-9);
}

TEST(Navigation, WhatIsUnderThePointerStaysThereWhileSliding) {
    Navigation n(lookingNorth(), kUp, 20);
    Motion m = inWindow(720);
    m.slide = {72, -36};
    const lod::View view = scene::makeView(lookingNorth(), 1440, 720, 1);
    n.move(m);
    // The target was in the middle; it is where the pointer went now.
    const glm::dvec3 seen = glm::dvec3(0) - n.camera().eye;
    EXPECT_NEAR(glm::dot(seen, view.right) / glm::dot(seen, view.forward) * view.focalPixels, 72, 1e-6);
    EXPECT_NEAR(glm::dot(seen, view.down) / glm::dot(seen, view.forward) * view.focalPixels, -36, 1e-6);
}

TEST(Navigation, StraightDownIsNoTrap) {
    scene::Camera camera = lookingNorth();
    camera.eye = {0, 0, 10};
    camera.up = {0, 1, 0};
    for (const bool flies : {false, true}) {
        Navigation n(camera, kUp, 20);
        if (flies) n.fly();
        Motion m = inWindow(720);
        m.slide = {5, 5};
        m.step = {1, 0, 1};
        n.move(m);
        m.turn = {0, -50};
        n.move(m);
        for (int i = 0; i < 3; ++i) {
            EXPECT_TRUE(std::isfinite(n.camera().eye[i]));
            EXPECT_TRUE(std::isfinite(n.camera().target[i]));
        }
    }
}

TEST(Navigation, WheelNeverReachesTheTargetNorLeavesNumbers) {
    Navigation n(lookingNorth(), kUp, 20);
    Motion m = inWindow(720);
    m.scroll = 1e4;
    for (int i = 0; i < 10; ++i) n.move(m);
    EXPECT_GT(glm::length(n.camera().eye - n.camera().target), 0);
    m.scroll = -1e4;
    for (int i = 0; i < 10; ++i) n.move(m);
    EXPECT_LT(glm::length(n.camera().eye - n.camera().target), 1e6);
}

TEST(Navigation, FliesAlongTheAxesOfItsView) {
    Navigation n(lookingNorth(), kUp, 20);
    n.fly();
    Motion m = inWindow(720);
    m.step = {0, 0, 1};
    n.move(m);
    const double far = n.camera().eye.y + 10;
    EXPECT_NEAR(far, 0.05 * n.speed(), 1e-9);
    m.fast = true;
    m.seconds = 100;  // the machine slept: no leap
    n.move(m);
    EXPECT_NEAR(n.camera().eye.y + 10 - far, 5 * 0.1 * n.speed(), 1e-9);
}

TEST(Navigation, AfterFlyingOrbitIsAboutWhatIsInTheMiddle) {
    Navigation n(lookingNorth(), kUp, 20);
    n.fly();
    Motion m = inWindow(720);
    m.step = {0, 0, 1};
    n.move(m);
    const glm::dvec3 eye = n.camera().eye;
    n.orbit(2.5, {100, 100, 100});
    EXPECT_FALSE(n.isFlying());
    expectNear(n.camera().eye, eye, 1e-12);
    expectNear(n.camera().target, eye + glm::dvec3(0, 2.5, 0), 1e-12);
}

TEST(Navigation, WithNothingInTheMiddleOrbitIsAboutTheScene) {
    Navigation n(lookingNorth(), kUp, 20);
    n.fly();
    n.orbit({}, {3, 4, 5});
    expectNear(n.camera().target, {3, 4, 5}, 1e-12);
    n.orbit({}, n.camera().eye);  // no direction: the camera stays as it is
    expectNear(n.camera().target, {3, 4, 5}, 1e-12);
}

TEST(Navigation, UpAxesAreAllTriedTheLikeliestFirst) {
    EXPECT_EQ(nextUpAxis(1, 1), 2) << "y-up by its format, but a scan that stands on xy";
    EXPECT_EQ(nextUpAxis(2, 2), 1);
    for (int own = 0; own < 3; ++own) {
        const int second = nextUpAxis(own, own), third = nextUpAxis(second, own);
        EXPECT_EQ(own + second + third, 3);
        EXPECT_NE(second, third);
        EXPECT_EQ(nextUpAxis(third, own), own);
    }
}

TEST(Navigation, DepthIsThatOfTheMiddleOrNextToIt) {
    render::Image image;
    image.width = 200;
    image.height = 100;
    EXPECT_FALSE(depthInTheMiddle(image)) << "no depths at all";
    image.depth.assign(200 * 100, 0);
    EXPECT_FALSE(depthInTheMiddle(image)) << "only background";
    image.depth[10 * 200 + 10] = 7;
    EXPECT_FALSE(depthInTheMiddle(image)) << "in a corner";
    image.depth[52 * 200 + 101] = 5;
    image.depth[54 * 200 + 104] = 3;
    EXPECT_EQ(depthInTheMiddle(image), 5.0) << "the nearest to the middle";
    image.depth[50 * 200 + 100] = 4;
    EXPECT_EQ(depthInTheMiddle(image), 4.0);
}

scene::CameraPath straight() {
    scene::CameraPath path;
    for (int i = 0; i < 3; ++i) {
        scene::Camera camera = lookingNorth();
        camera.eye.x = i;
        path.keys.push_back({5.0 + i, camera});
    }
    return path;
}

TEST(PathPlayer, PlaysPausesAndEnds) {
    PathPlayer p(straight(), 1, false);
    EXPECT_TRUE(p.isPlaying());
    p.advance(1);
    EXPECT_NEAR(p.camera().eye.x, 1, 1e-12);
    p.toggle();
    p.advance(1);
    EXPECT_NEAR(p.camera().eye.x, 1, 1e-12);
    p.toggle();
    p.advance(10);
    EXPECT_FALSE(p.isPlaying()) << "it ended";
    EXPECT_NEAR(p.camera().eye.x, 2, 1e-12);
    p.toggle();
    EXPECT_TRUE(p.isPlaying());
    EXPECT_NEAR(p.camera().eye.x, 0, 1e-12) << "again from the start";
}

TEST(PathPlayer, LoopsAndSpeed) {
    PathPlayer p(straight(), 2, true);
    p.advance(1.25);
    EXPECT_TRUE(p.isPlaying());
    EXPECT_NEAR(p.camera().eye.x, straight().at(5.5).eye.x, 1e-12);
    PathPlayer none;
    none.toggle();
    none.advance(1);
    EXPECT_FALSE(none.isPlaying());
}

TEST(Pace, NothingChangesNothingIsDrawn) {
    const Pace pace = paceOf({});
    EXPECT_FALSE(pace.draws);
    EXPECT_GE(pace.waitSeconds, 0.2);
}

TEST(Pace, AHiddenWindowNeverDraws) {
    Activity a;
    a.isHidden = a.hasChanged = a.isMoving = a.hasArrived = a.isStreaming = true;
    EXPECT_FALSE(paceOf(a).draws);
    EXPECT_GE(paceOf(a).waitSeconds, 0.2);
}

TEST(Pace, WhatChangesIsDrawn) {
    for (bool Activity::*reason : {&Activity::hasChanged, &Activity::isMoving, &Activity::hasArrived}) {
        Activity a;
        a.*reason = true;
        EXPECT_TRUE(paceOf(a).draws);
    }
    Activity flying;
    flying.isMoving = true;
    EXPECT_EQ(paceOf(flying).waitSeconds, 0) << "each frame differs";
}

TEST(Pace, ChunksOnTheirWayAreLookedForButNotDrawnBeforeTheyCome) {
    Activity a;
    a.isStreaming = true;
    EXPECT_FALSE(paceOf(a).draws);
    EXPECT_LE(paceOf(a).waitSeconds, 0.02);
}

TEST(Pace, ALineOnTheScreenGoesInTime) {
    Notices notices;
    notices.add("a", false, 100);
    notices.add("b", true, 101);
    Activity a;
    a.untilNotice = notices.untilNext(107.9);
    EXPECT_NEAR(paceOf(a).waitSeconds, 0.1, 1e-9);
    EXPECT_FALSE(notices.expire(107.9));
    EXPECT_TRUE(notices.expire(108));
    ASSERT_EQ(notices.lines().size(), 1u);
    EXPECT_EQ(notices.lines()[0].text, "b");
    for (int i = 0; i < 20; ++i) notices.add("again", true, 102);
    EXPECT_EQ(notices.lines().size(), Notices::kMost) << "they never fill the screen";
}

TEST(Pace, FramesAreAddedUpOnlyWhileNothingChangesAndNoMoreThanAreAskedFor) {
    Accumulating a(20);
    EXPECT_FALSE(a.isDue(true)) << "the first look after a change";
    uint32_t looks = 0;
    for (; a.isDue(true); ++looks) {
        EXPECT_EQ(a.isShown(), looks >= Accumulating::kLeast) << "a few are not shown";
        a.add();
    }
    EXPECT_EQ(looks, 20u);
    EXPECT_EQ(a.count(), 20u);
    EXPECT_TRUE(a.isShown());
    a.clear();
    EXPECT_FALSE(a.isDue(false));
    EXPECT_FALSE(a.isDue(true)) << "waiting begins anew";
    EXPECT_TRUE(a.isDue(true));
    Accumulating none(1);
    for (int look = 0; look < 5; ++look) EXPECT_FALSE(none.isDue(true));
}

}  // namespace
}  // namespace stipple::app
