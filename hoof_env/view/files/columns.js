// Columns of numbers that grow at their end and forget their beginning.

class GrowingColumns {
  constructor(names, most) {
    this.names = names
    this.most = most
    this.store = names.map(() => new Float64Array(2 * most))
    this.clear()
  }

  clear() {
    this.begin = 0
    this.end = 0
  }

  // Rows are given one column after the other.
  add(numbers, count) {
    const kept = Math.min(count, this.most)
    if (this.end + kept > 2 * this.most) {
      const begin = Math.max(this.begin, this.end - (this.most - kept))
      for (const values of this.store) {
        values.copyWithin(0, begin, this.end)
      }
      this.end -= begin
      this.begin = 0
    }
    this.store.forEach((values, k) => values.set(numbers.subarray((k + 1) * count - kept, (k + 1) * count), this.end))
    this.end += kept
    this.begin = Math.max(this.begin, this.end - this.most)
  }

  get data() {
    return Object.fromEntries(this.names.map((name, k) => [name, this.store[k].subarray(this.begin, this.end)]))
  }

  get last_time() {
    return this.end > this.begin ? this.store[this.names.indexOf("time")][this.end - 1] : null
  }
}
