// Moves the sun so that it lights about kLitShare of a view inside a scene. Runs once, after the
// first complete view. A shadow test for a candidate position can need tiles that are not loaded
// yet. The search requests these tiles, and is repeated until no tile is missing or it makes no
// progress.

const kLitShare = 0.35;    // share of the visible surface that the sun should light
const kMaxIdleTrials = 8;  // consecutive trials that do not reduce the number of missing tiles

export class SunSearch {
  constructor(context, light) {
    this.context = context;
    this.light = light;
    this.idleTrials = 0;
    this.fewestMissing = Infinity;
    this.usablePasses = null;  // Passes whose search programs are compiled
  }

  get isOver() {
    return this.light.outside || this.idleTrials >= kMaxIdleTrials;
  }

  // Runs one trial with the picture that was drawn last. Returns true if it moved the sun.
  run(values, loader, nowMs) {
    const {passes} = this.context;
    if (this.usablePasses !== passes) {
      this.compile(passes);
      return false;
    }
    const {place, wanted} = passes.chooseSun({...values, u_turn: this.light.turn}, kLitShare);
    this.idleTrials = wanted.size < this.fewestMissing ? 0 : this.idleTrials + 1;
    this.fewestMissing = Math.min(this.fewestMissing, wanted.size);
    if (wanted.size > 0 && this.idleTrials < kMaxIdleTrials && !loader.isFull) {
      loader.demand(wanted, nowMs);
      return false;
    }
    this.end();
    this.light.setSun(place);
    return true;
  }

  compile(passes) {
    passes.compileLater().then((usable) => {
      if (usable) this.usablePasses = passes;
    }, () => this.end());
  }

  end() {
    this.idleTrials = kMaxIdleTrials;
  }
}
